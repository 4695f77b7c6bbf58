//! The two loops that solving spends its time in, in lanes so that the compiler can use vector registers.

/// Values handled side by side.
const LANES: usize = 8;

/// A greatest value and where it is; of equals the first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Greatest {
    pub value: f32,
    pub index: usize,
}

/// The greatest value in each lane, and in which chunk of lanes.
struct Lanes {
    values: [f32; LANES],
    chunks: [u32; LANES],
}

impl Lanes {
    fn new() -> Self {
        Self { values: [f32::NEG_INFINITY; LANES], chunks: [0; LANES] }
    }

    #[inline(always)]
    fn offer(&mut self, chunk: usize, values: [f32; LANES]) {
        for ((best, best_chunk), value) in self.values.iter_mut().zip(&mut self.chunks).zip(values) {
            let greater = value > *best;
            *best = if greater { value } else { *best };
            *best_chunk = if greater { chunk as u32 } else { *best_chunk };
        }
    }

    fn greatest(&self) -> Greatest {
        let lanes = self.values.iter().zip(&self.chunks).enumerate();
        let lanes =
            lanes.map(|(lane, (&value, &chunk))| Greatest { value, index: chunk as usize * LANES + lane });
        let none = Greatest { value: f32::NEG_INFINITY, index: 0 };
        lanes.fold(none, |best, lane| {
            let earlier = lane.value == best.value && lane.index < best.index;
            if lane.value > best.value || earlier { lane } else { best }
        })
    }
}

/// Subtracts `step`·(up − down) from the residuals. Gives the greatest residual + rise, and the least residual + fall.
///
/// All slices are of one length.
pub(super) fn shift(
    step: f32,
    residuals: &mut [f32],
    (up, down): (&[f32], &[f32]),
    (rise, fall): (&[f32], &[f32]),
) -> (Greatest, f32) {
    let mut highest = Lanes::new();
    let mut lowest = [f32::INFINITY; LANES];
    let (chunks, tail) = residuals.as_chunks_mut::<LANES>();
    let (up, up_tail) = up.as_chunks::<LANES>();
    let (down, down_tail) = down.as_chunks::<LANES>();
    let (rise, rise_tail) = rise.as_chunks::<LANES>();
    let (fall, fall_tail) = fall.as_chunks::<LANES>();
    let done = chunks.len();
    let (up, down, rise, fall) = (&up[..done], &down[..done], &rise[..done], &fall[..done]);
    for (chunk, residuals) in chunks.iter_mut().enumerate() {
        let (up, down, rise, fall) = (&up[chunk], &down[chunk], &rise[chunk], &fall[chunk]);
        // One operation at a time over all lanes: a loop over lanes with all of them is not made into vectors.
        let mut moved = *residuals;
        for lane in 0..LANES {
            moved[lane] -= step * (up[lane] - down[lane]);
        }
        *residuals = moved;
        let (mut high, mut low) = (moved, moved);
        for lane in 0..LANES {
            high[lane] += rise[lane];
        }
        for lane in 0..LANES {
            low[lane] += fall[lane];
        }
        for lane in 0..LANES {
            lowest[lane] = if low[lane] < lowest[lane] { low[lane] } else { lowest[lane] };
        }
        highest.offer(chunk, high);
    }
    let mut highest = highest.greatest();
    let mut lowest = lowest.into_iter().fold(f32::INFINITY, f32::min);
    for (index, residual) in tail.iter_mut().enumerate() {
        *residual -= step * (up_tail[index] - down_tail[index]);
        let value = *residual + rise_tail[index];
        if value > highest.value {
            highest = Greatest { value, index: done * LANES + index };
        }
        lowest = lowest.min(*residual + fall_tail[index]);
    }
    (highest, lowest)
}

/// Least curvature along a direction, LIBSVM's τ: two samples in one place have none.
const LEAST_CURVATURE: f32 = 1e-12;

/// The curvature of the dual along a step of two samples with this kernel.
pub(super) fn curvature(kernel: f32) -> f32 {
    let curvature = 2.0 - 2.0 * kernel;
    if curvature > LEAST_CURVATURE { curvature } else { LEAST_CURVATURE }
}

/// The sample whose weight should fall when that of another with residual `top` and kernel `row` rises: where the
/// step gains most, (top − residual)² / curvature; 0 where it gains nothing.
///
/// All slices are of one length.
pub(super) fn partner(top: f32, residuals: &[f32], fall: &[f32], row: &[f32]) -> Greatest {
    let gain = |residual: f32, fall: f32, kernel: f32| {
        let gap = top - residual - fall;
        let gap = if gap > 0.0 { gap } else { 0.0 };
        gap * gap / curvature(kernel)
    };
    let mut best = Lanes::new();
    let (residuals, residuals_tail) = residuals.as_chunks::<LANES>();
    let (fall, fall_tail) = fall.as_chunks::<LANES>();
    let (row, row_tail) = row.as_chunks::<LANES>();
    let done = residuals.len();
    let (fall, row) = (&fall[..done], &row[..done]);
    for (chunk, residuals) in residuals.iter().enumerate() {
        let (fall, row) = (&fall[chunk], &row[chunk]);
        let mut gains = [0.0; LANES];
        for lane in 0..LANES {
            gains[lane] = gain(residuals[lane], fall[lane], row[lane]);
        }
        best.offer(chunk, gains);
    }
    let mut best = best.greatest();
    for (index, ((&residual, &fall), &kernel)) in
        residuals_tail.iter().zip(fall_tail).zip(row_tail).enumerate()
    {
        let value = gain(residual, fall, kernel);
        if value > best.value {
            best = Greatest { value, index: done * LANES + index };
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values without order, some of them equal.
    fn values(count: usize, seed: usize) -> Vec<f32> {
        (0..count).map(|i| ((i * 7 + seed * 13) % 11) as f32 / 8.0 - 0.5).collect()
    }

    fn first_greatest(values: impl Iterator<Item = f32>) -> Greatest {
        let none = Greatest { value: f32::NEG_INFINITY, index: 0 };
        values.enumerate().fold(
            none,
            |best, (index, value)| {
                if value > best.value { Greatest { value, index } } else { best }
            },
        )
    }

    #[test]
    fn lanes_and_what_is_left_over_count_alike() {
        for n in 0..40 {
            let (up, down) = (values(n, 1), values(n, 2));
            let bound = |every: usize, value: f32| -> Vec<f32> {
                (0..n).map(|i| if i % every == 0 { value } else { 0.0 }).collect()
            };
            let (rise, fall) = (bound(3, f32::NEG_INFINITY), bound(4, f32::INFINITY));
            let mut residuals = values(n, 3);
            let expected: Vec<f32> =
                residuals.iter().zip(&up).zip(&down).map(|((r, u), d)| r - 0.5 * (u - d)).collect();
            let (highest, lowest) = shift(0.5, &mut residuals, (&up, &down), (&rise, &fall));
            assert_eq!(residuals, expected, "{n}");
            assert_eq!(highest, first_greatest(expected.iter().zip(&rise).map(|(r, b)| r + b)), "{n}");
            let lows = expected.iter().zip(&fall).map(|(r, b)| r + b);
            assert_eq!(lowest, lows.fold(f32::INFINITY, f32::min), "{n}");

            let gains = expected.iter().zip(&fall).zip(&up).map(|((r, f), k)| {
                let gap = (0.75 - r - f).max(0.0);
                gap * gap / (2.0 - 2.0 * k)
            });
            assert_eq!(partner(0.75, &residuals, &fall, &up), first_greatest(gains), "{n}");
        }
    }
}
