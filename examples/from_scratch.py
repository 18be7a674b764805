"""Both engines in a hundred lines

Event-driven and time-stepped simulation of the three-ball problem without the package: a floor, a heavy ball and a
light ball 0.1 mm above it. The light ball meets the heavy ball while the floor still pushes the heavy ball. Soft
spheres then have four contacts instead of one. Only the check at the end imports `granular`.

Source: P. Müller and T. Pöschel, Phys. Rev. E 83, 041304 (2011), Fig. 1.
"""

import math

from sortedcontainers import SortedList

GRAVITY = 9.81  # m/s²
RADIUS = (0.0, 0.1, 0.01)  # m; body 0 is the floor
MASS = (math.inf, *(4 / 3 * math.pi * r**3 * 900.0 for r in RADIUS[1:]))  # kg
HEIGHT = (0.0, 0.6, 0.6 + 0.1 + 1e-4 + 0.01)  # m, centres at t = 0, all bodies at rest
STIFFNESS = 5e7  # N/m
RESTITUTION = 0.7


def effective_mass(pair):
    """Return m_a m_b / (m_a + m_b) of bodies `pair` and `pair` + 1 in kg.

    The floor has infinite mass.
    """
    return 1 / (1 / MASS[pair] + 1 / MASS[pair + 1])


def hard_spheres():
    """Return the separation speed of the balls in m/s, and the collisions per pair.

    Between collisions both balls have the same acceleration, so the gap of the balls is linear in time. The gap to the
    floor is quadratic. The event queue holds the next collision of each pair.
    """
    time, height, velocity, collisions = 0.0, list(HEIGHT), [0.0, 0.0, 0.0], [0, 0]
    queue = SortedList()

    def predict(pair):
        """Add the next collision of a pair to the queue."""
        gap = height[pair + 1] - height[pair] - RADIUS[pair + 1] - RADIUS[pair]
        closing = velocity[pair] - velocity[pair + 1]
        if pair == 0:  # the floor does not fall: gap = closing t + g t²/2
            after = (-closing + math.sqrt(closing**2 + 2 * GRAVITY * max(gap, 0.0))) / GRAVITY
        else:
            after = gap / closing if closing > 0.0 else math.inf
        queue.add((time + after, pair))

    for pair in (0, 1):
        predict(pair)
    while True:
        event, pair = queue.pop(0)
        if pair == 0 and collisions[0] == 1:
            return velocity[2] - velocity[1], collisions
        step = event - time
        for ball in (1, 2):
            height[ball] += step * (velocity[ball] - 0.5 * GRAVITY * step)
            velocity[ball] -= GRAVITY * step
        time = event
        collisions[pair] += 1
        impulse = (1 + RESTITUTION) * effective_mass(pair) * (velocity[pair] - velocity[pair + 1])
        velocity[pair] -= impulse / MASS[pair]
        velocity[pair + 1] += impulse / MASS[pair + 1]
        queue.clear()  # in a longer chain only the entries of the two neighbouring pairs are replaced
        for pair in (0, 1):
            predict(pair)


def soft_spheres(step=1e-8):
    """Return the separation speed of the balls in m/s, and the contacts per pair.

    The speed is taken after the last contact of the balls. Velocity Verlet has a constant time `step` in s. The force
    of a pair with overlap ξ is k ξ + γ dξ/dt where ξ and this sum are positive, and 0 elsewhere.
    """
    damping = [damping_for(effective_mass(pair)) for pair in (0, 1)]
    fall = math.sqrt(2 * (HEIGHT[1] - RADIUS[1]) / GRAVITY) - 1e-6  # free fall in closed form until 1 µs before impact
    height = [0.0, *(z - 0.5 * GRAVITY * fall**2 for z in HEIGHT[1:])]
    velocity, contacts, touching = [0.0, -GRAVITY * fall, -GRAVITY * fall], [0, 0], [False, False]

    def accelerations():
        """Return the accelerations of both balls in m/s², and count contacts that begin."""
        push = [0.0, 0.0]
        for pair in (0, 1):
            overlap = RADIUS[pair] + RADIUS[pair + 1] + height[pair] - height[pair + 1]
            if overlap > 0.0:
                rate = velocity[pair] - velocity[pair + 1]
                push[pair] = max(0.0, STIFFNESS * overlap + damping[pair] * rate)
            contacts[pair] += push[pair] > 0.0 and not touching[pair]
            touching[pair] = push[pair] > 0.0
        return (push[0] - push[1]) / MASS[1] - GRAVITY, push[1] / MASS[2] - GRAVITY

    acceleration = accelerations()
    while True:
        for ball in (1, 2):
            velocity[ball] += 0.5 * step * acceleration[ball - 1]
            height[ball] += step * velocity[ball]
        acceleration = accelerations()
        for ball in (1, 2):
            velocity[ball] += 0.5 * step * acceleration[ball - 1]
        if touching[1]:
            separation = velocity[2] - velocity[1]  # the floor may push the lower ball further up after this contact
        if contacts[0] and not any(touching) and height[1] > RADIUS[1] and velocity[2] > velocity[1]:
            return separation, contacts


def damping_for(mass):
    """Return the damping constant γ in kg/s of an isolated contact with `RESTITUTION`.

    A contact that ends when its force vanishes has ln ε = -β/ω (π - atan2(2 β ω, ω² - β²)) with the damping ratio ζ,
    β = ζ ω₀, ω = ω₀ √(1 - ζ²) and ω₀ = √(k/m) (Schwager and Pöschel, Granular Matter 9, 465, 2007). ζ is found by
    bisection.
    """
    low, high = 0.0, 1.0
    for _ in range(60):  # until the interval has the size of a rounding error
        ratio = (low + high) / 2
        root = math.sqrt(1 - ratio**2)
        found = math.exp(-ratio / root * (math.pi - math.atan2(2 * ratio * root, 1 - 2 * ratio**2)))
        low, high = (ratio, high) if found > RESTITUTION else (low, ratio)
    return 2 * low * math.sqrt(STIFFNESS * mass)


if __name__ == "__main__":
    hard, hard_count = hard_spheres()
    soft, soft_count = soft_spheres()
    print(f"hard spheres: the balls separate at {hard:.4f} m/s, contacts {hard_count}")
    print(f"soft spheres: the balls separate at {soft:.4f} m/s, contacts {soft_count}")

    import granular as gr

    scene = gr.scenes.three_balls(gap=1e-4)
    law = [gr.LinearDashpot.from_restitution(RESTITUTION, k=STIFFNESS, pair=pair) for pair in scene.pairs]
    report = gr.compare(scene, law, until=gr.until.contact(pair=0, nth=2))
    assert abs(hard - report.pairs[1].hard_v_rel) < 1e-9
    assert abs(soft - report.pairs[1].soft_v_rel) < 1e-3
    assert (hard_count, soft_count) == ([1, 1], [1, 4])
    print("granular.compare gives the same results.")

# sphinx_gallery_thumbnail_path = "figures/paper-forces.png"
