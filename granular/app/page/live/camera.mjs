// Where balls are in the picture: one camera that comes near. Heights have the radii taken out; balls stand on one another.
//
// From far the scale shows the whole flight, and balls are drawn larger than that where they would be specks (`larger`). From
// near it shows the balls as large as they fit; where contacts are brief, paths and overlaps are drawn larger than the balls
// (`times`). Radii keep their ratios in both; none is less than TINIEST pixels.
import { max, min, sqrt, sum } from "../physics/numbers.mjs";

const TINIEST = 2, SMALL = 10, LARGE = 36, BELOW = 30, TOP = 58; // pixels
const ROUND = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000];

export class Camera {
  // `most`: the greatest height in m; `reach`: how far a ball falls while the longest contact lasts; `size` of specks;
  // `fullest`: the radius that the top ball can be given.
  constructor({ scene, wide, tall, most, reach, size = 1, fullest = 0 }) {
    const radii = scene.radius, largest = max(...radii), smallest = min(...radii.filter(Boolean)), pile = 2 * (sum(radii) + max(0, fullest - radii[radii.length - 1]));
    const room = tall - BELOW - TOP, way = max(reach, 0.5 * sum(scene.gap.slice(1))), share = (0.45 * largest) / way;
    const times = ROUND.findLast((n) => n <= share) ?? 1, near = min(room / (pile + 2.2 * times * way), (0.3 * wide) / largest);
    const unit = min((size * SMALL) / smallest, (size * LARGE) / largest, (0.3 * room) / pile), far = (room - unit * pile) / most, isTrue = far > unit;
    const scale = isTrue ? room / (most + pile) : far;
    Object.assign(this, { radii, wide, tall, times, larger: isTrue ? 1 : unit / scale, most });
    this.ends = [[scale, isTrue ? scale : unit], [near * times, near]];
  }

  // Pixels of a metre of height, and of a metre of radius.
  scales(zoom) {
    const [[far, unit], [near, close]] = this.ends;
    return [far ** (1 - zoom) * near ** zoom, unit ** (1 - zoom) * close ** zoom];
  }

  // Of each ball: its lowest point above the floor, where that is while all stand on one another, radius, and by how much it is
  // cut off below and above where it is pressed in. Two balls share an overlap so that both have one patch.
  place(heights, zoom = 0) {
    const [scale, unit] = this.scales(zoom), balls = [];
    let stacked = 0;
    heights.forEach((y, i) => {
      const r = this.radii[i] ? max(TINIEST, this.radii[i] * unit) : 0;
      balls.push({ low: stacked + y * scale, zero: stacked, r, below: 0, above: 0 });
      stacked += 2 * r;
    });
    balls.slice(1).forEach((ball, i) => {
      const under = balls[i], deep = max(0, under.low + 2 * under.r - ball.low), both = under.r + ball.r;
      if (under.r === 0) ball.below = deep;
      else [ball.below, under.above] = [(deep * under.r) / both, (deep * ball.r) / both];
    });
    return balls;
  }

  // From the top of the picture.
  down(above) {
    return this.tall - BELOW - above;
  }

  // A height above where ball i stands, in m, at so many pixels from the top.
  heightAt(pixels, i, zoom) {
    const rest = this.place(this.radii.map(() => 0), zoom)[i].zero;
    return (this.tall - BELOW - pixels - rest) / this.scales(zoom)[0];
  }
}

// By how much wider a disc of radius r is for what is cut off, its area being kept.
export function bulge({ r, below, above }) {
  const gone = [below, above].reduce((all, cut) => all + segment(r, min(cut, r)), 0);
  return 1 / max(0.7, 1 - gone / (Math.PI * r * r));
}

const segment = (r, cut) => r * r * Math.acos(1 - cut / r) - (r - cut) * sqrt(max(0, 2 * r * cut - cut * cut));
