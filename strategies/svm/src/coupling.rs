//! From the probabilities of pairs to those of all classes.

/// Each probability is right to about this much. LIBSVM stops at 0.005 / classes, too coarse for the small
/// probabilities whose logarithms are added up as evidence.
const TOLERANCE: f64 = 1e-7;
/// Far more than the few tens of rounds it takes.
const MAX_ITERATIONS: usize = 1000;

/// Couples pairwise probabilities: minimises Σᵢ Σⱼ≠ᵢ (rⱼᵢ·pᵢ − rᵢⱼ·pⱼ)² over distributions p, where
/// rᵢⱼ = P(i | i or j).
///
/// T.-F. Wu, C.-J. Lin, R. C. Weng, "Probability estimates for multi-class classification by pairwise coupling",
/// JMLR 5 (2004), the second approach, algorithm 2. `pairs` holds rᵢⱼ for i < j, by i then j, each strictly
/// between 0 and 1.
pub(crate) fn couple(pairs: impl IntoIterator<Item = f64>, classes: usize) -> Vec<f64> {
    let mut q = vec![0.0; classes * classes];
    let mut of_pair = pairs.into_iter();
    for i in 0..classes {
        for j in i + 1..classes {
            let r = of_pair.next().unwrap_or(0.5);
            q[i * classes + i] += (1.0 - r) * (1.0 - r);
            q[j * classes + j] += r * r;
            q[i * classes + j] = -(1.0 - r) * r;
            q[j * classes + i] = q[i * classes + j];
        }
    }

    let mut p = vec![1.0 / classes as f64; classes];
    let mut qp = vec![0.0; classes];
    for _ in 0..MAX_ITERATIONS {
        // Recomputed each time: the updates below would let rounding errors grow.
        for (value, row) in qp.iter_mut().zip(q.chunks_exact(classes)) {
            *value = row.iter().zip(&p).map(|(a, b)| a * b).sum();
        }
        let mut pqp: f64 = p.iter().zip(&qp).map(|(a, b)| a * b).sum();
        if qp.iter().all(|value| (value - pqp).abs() < TOLERANCE) {
            break;
        }
        for t in 0..classes {
            let row = &q[t * classes..(t + 1) * classes];
            let step = (pqp - qp[t]) / row[t];
            p[t] += step;
            let norm = 1.0 + step;
            pqp = (pqp + step * (step * row[t] + 2.0 * qp[t])) / (norm * norm);
            for ((value, probability), &element) in qp.iter_mut().zip(&mut p).zip(row) {
                *value = (*value + step * element) / norm;
                *probability /= norm;
            }
        }
    }
    // The iteration keeps the sum at 1 up to rounding.
    let sum: f64 = p.iter().sum();
    p.iter_mut().for_each(|probability| *probability /= sum);
    p
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn consistent_pairs_give_back_the_distribution_they_came_from() {
        for p in [vec![0.3, 0.7], vec![0.6, 0.3, 0.1], vec![0.97, 0.01, 0.01, 0.006, 0.004]] {
            let n = p.len();
            let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
            let coupled = couple(pairs.map(|(i, j)| p[i] / (p[i] + p[j])), n);
            assert!(coupled.iter().zip(&p).all(|(a, b)| (a - b).abs() < 1e-5), "{coupled:?} for {p:?}");
        }
    }

    #[test]
    fn contradicting_pairs_give_the_least_squares_solution() {
        // Solved as the linear system (19) of the paper with numpy: r01 = .9, r02 = .6, r12 = .8.
        let coupled = couple([0.9, 0.6, 0.8], 3);
        let expected = [0.6281914, 0.1553315, 0.2164772];
        assert!(coupled.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{coupled:?}");
    }

    #[test]
    fn near_certain_pairs_of_many_classes_converge() {
        let classes = 64;
        let coupled = couple(std::iter::repeat_n(1.0 - 1e-7, classes * (classes - 1) / 2), classes);
        assert!(coupled[0] > 0.999 && coupled.iter().all(|p| (0.0..=1.0).contains(p)), "{coupled:?}");
    }
}
