// What is asked of numbers everywhere, by short names.
export const abs = Math.abs;
export const floor = Math.floor;
export const log10 = Math.log10;
export const max = Math.max;
export const min = Math.min;
export const round = Math.round;
export const sqrt = Math.sqrt;
export const sum = (values) => values.reduce((a, b) => a + b, 0);
