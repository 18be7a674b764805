// A simulated recording of a basketball: heights in mm, 25 pictures per second, read to ±3 mm. Its restitution grows from
// 0.82 at 4.5 m/s to 0.86 at 0.5 m/s, which neither model knows (tests/app/page/test_measured.py makes it again).
import { told } from "./words.mjs";

const PER_SECOND = 25;
const HEIGHTS_IN_MM = "1003 983 968 934 871 804 722 612 500 370 217 55 99 225 338 427 514 575 619 658 673 671 655 628 576 515 445 348 242 114 27 129 230 307 371 419 444 461 467 449 417 362 309 226 133 15 80 151 225 271 304 317 322 306 272 232 169 88 4 74 136 178 208 228 232 205 173 123 63 25 78 120 152 164 158 140";

export const RECORDED = HEIGHTS_IN_MM.split(" ").map((mm, i) => [i / PER_SECOND, mm / 1000]);
