//! Machines of many samples at once, by linfa's solver.

use linfa::DatasetBase;
use linfa::traits::Fit;
use linfa_svm::{Svm, SvmError};
use ndarray::{Array1, Array2};

use crate::machine::{Machine, pairs};

/// LIBSVM's stopping tolerance.
const TOLERANCE: f64 = 1e-3;

impl Machine {
    /// Fits a machine to each pair. `members[k]` are the samples of class k, all `width` long, none empty.
    pub fn fit(members: &[Vec<&[f32]>], width: usize, cost: f64, gamma: f64) -> Result<Self, SvmError> {
        // What each sample weighs in each pair; samples that weigh nothing anywhere are no support vectors.
        let mut used: Vec<Vec<bool>> = members.iter().map(|samples| vec![false; samples.len()]).collect();
        let mut solutions = Vec::new();
        for (i, j) in pairs(members.len()) {
            let solution = fit_pair(&members[i], &members[j], width, cost, gamma)?;
            let (first, second) = solution.alpha.split_at(members[i].len());
            for (class, weights) in [(i, first), (j, second)] {
                for (used, weight) in used[class].iter_mut().zip(weights) {
                    *used |= *weight as f32 != 0.0;
                }
            }
            solutions.push(solution);
        }

        let mut weights = Vec::new();
        for ((i, j), solution) in pairs(members.len()).zip(&solutions) {
            let (first, second) = solution.alpha.split_at(members[i].len());
            for (class, alpha) in [(i, first), (j, second)] {
                let kept = alpha.iter().zip(&used[class]).filter(|(_, used)| **used);
                weights.extend(kept.map(|(&alpha, _)| alpha as f32));
            }
        }
        let kept = members.iter().zip(&used);
        let kept = kept.flat_map(|(samples, used)| samples.iter().zip(used).filter(|(_, used)| **used));
        Ok(Self {
            gamma: gamma as f32,
            width,
            vectors: kept.flat_map(|(sample, _)| sample.iter().copied()).collect(),
            counts: used.iter().map(|used| used.iter().filter(|used| **used).count()).collect(),
            weights,
            offsets: solutions.iter().map(|solution| solution.rho).collect(),
        })
    }
}

fn fit_pair(
    first: &[&[f32]],
    second: &[&[f32]],
    width: usize,
    cost: f64,
    gamma: f64,
) -> Result<Svm<f64, bool>, SvmError> {
    let rows = first.iter().chain(second);
    let records = Array2::from_shape_vec(
        (first.len() + second.len(), width),
        rows.flat_map(|row| row.iter().map(|&x| f64::from(x))).collect(),
    )
    .expect("each sample has `width` components");
    let targets: Array1<bool> = (0..first.len() + second.len()).map(|i| i < first.len()).collect();
    Svm::<f64, bool>::params()
        .pos_neg_weights(cost, cost)
        // linfa writes the kernel as exp(−|x − y|² / ε).
        .gaussian_kernel(1.0 / gamma)
        // Its default of 1e-7 costs several times the iterations for the same predictions.
        .eps(TOLERANCE)
        // Shrinking panics or worsens the solution in linfa-svm 0.8.
        .shrinking(false)
        .fit(&DatasetBase::new(records, targets))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decisions(machine: &Machine, x: &[f32]) -> Vec<f64> {
        let mut decisions = Vec::new();
        machine.decide(x, &mut decisions);
        decisions
    }

    #[test]
    fn a_pair_decides_as_libsvm_does() {
        // sklearn.svm.SVC(C=2, gamma=0.5, tol=1e-6) 1.9.1, which is LIBSVM, on the same 20 samples.
        let sample = |i: usize| {
            let side = if i < 10 { 0.5 } else { -0.5 };
            [((5 * i) as f64).sin() + side, ((3 * i) as f64).cos() + side].map(|v| v as f32)
        };
        let samples: Vec<[f32; 2]> = (0..20).map(sample).collect();
        let of = |samples: &[[f32; 2]]| -> Vec<Vec<f32>> { samples.iter().map(|s| s.to_vec()).collect() };
        let (first, second) = (of(&samples[..10]), of(&samples[10..]));
        let members: Vec<Vec<&[f32]>> =
            [&first, &second].map(|class| class.iter().map(Vec::as_slice).collect()).to_vec();
        let machine = Machine::fit(&members, 2, 2.0, 0.5).unwrap();
        assert_eq!(machine.counts.iter().sum::<usize>(), 14);
        for (x, expected) in [
            ([0.0, 0.0], -0.233_87),
            ([1.0, 1.0], 1.076_38),
            ([-1.0, 1.0], 0.099_20),
            ([0.3, -0.8], -0.580_71),
            ([-2.0, -2.0], -0.432_18),
        ] {
            let found = decisions(&machine, &x)[0];
            // LIBSVM's default tolerance, which is ours, leaves this much open.
            assert!((found - expected).abs() < 2e-3, "{found} for {expected}");
        }
    }

    #[test]
    fn each_pair_is_what_it_would_be_alone() {
        let class = |k: usize| -> Vec<Vec<f32>> {
            (0..8).map(|i| vec![(i * (k + 2)) as f32 % 5.0, (k as f32) + 0.2 * (i % 3) as f32]).collect()
        };
        let classes: Vec<Vec<Vec<f32>>> = (0..4).map(class).collect();
        let slices: Vec<Vec<&[f32]>> =
            classes.iter().map(|rows| rows.iter().map(Vec::as_slice).collect()).collect();
        let all = decisions(&Machine::fit(&slices, 2, 1.0, 0.7).unwrap(), &[1.0, 1.5]);
        for ((i, j), together) in pairs(4).zip(all) {
            let pair = [slices[i].clone(), slices[j].clone()];
            let alone = decisions(&Machine::fit(&pair, 2, 1.0, 0.7).unwrap(), &[1.0, 1.5])[0];
            assert!((together - alone).abs() < 1e-5, "{i} {j}: {together} and {alone}");
        }
    }
}
