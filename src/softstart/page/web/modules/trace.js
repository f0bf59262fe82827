// A start as the browser has it: channels over time, what they are at an instant, and where the bodies stand.
// `T`, `theta`, `w1` and `w2` are those of the shaft with the largest torque, of motor and load.
export function unpack(packed) {
  if (!packed?.data) return packed;
  const all = new Float32Array(Uint8Array.from(atob(packed.data), (letter) => letter.charCodeAt(0)).buffer);
  const size = all.length / packed.channels.length;
  const found = { ...packed, data: undefined };
  packed.channels.forEach((name, row) => (found[name] = all.subarray(row * size, (row + 1) * size)));
  const { worst, motor, load } = packed;
  return Object.assign(found, { T: found[`T[${worst}]`], theta: found[`theta[${worst}]`], w1: found[`w[${motor}]`], w2: found[`w[${load}]`] });
}

// index of the first instant that is not before t
export function indexAt(times, t) {
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < t) low = middle + 1;
    else high = middle;
  }
  return low;
}

// the value of one channel at t, NaN after the end
export function valueAt(trace, channel, t) {
  const i = indexAt(trace.t, t);
  const values = trace[channel];
  if (i >= trace.t.length) return NaN;
  if (i === 0) return values[0];
  const step = trace.t[i] - trace.t[i - 1];
  return values[i - 1] + (step > 0 ? (t - trace.t[i - 1]) / step : 1) * (values[i] - values[i - 1]);
}

// least and largest value between two instants, neighbours beyond them included
export function extent(trace, channel, [from, to], low = Infinity, high = -Infinity) {
  const values = trace[channel];
  const last = Math.min(indexAt(trace.t, to) + 1, values.length);
  for (let i = Math.max(indexAt(trace.t, from) - 1, 0); i < last; i++) {
    if (values[i] < low) low = values[i];
    if (values[i] > high) high = values[i];
  }
  return [low, high];
}

// angle of a body since the start: its speed summed up
export function angleAt(trace, channel, t) {
  const speeds = trace[channel];
  const sums = ((trace.sums ??= {})[channel] ??= speeds.reduce((found, w, i) => {
    if (i) found[i] = found[i - 1] + 0.5 * (trace.t[i] - trace.t[i - 1]) * (w + speeds[i - 1]);
    return found;
  }, new Float64Array(speeds.length)));
  const i = Math.min(indexAt(trace.t, t), sums.length - 1);
  return sums[i] + (t - trace.t[i]) * speeds[i];
}

// the stage of an instant as [start, end, side]: side 0 while the gap is open
export const stageAt = (stages, t) => stages.findLast(([start]) => start <= t) ?? [0, Infinity, 0];
