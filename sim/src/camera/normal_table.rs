//! Normally distributed numbers from a table: one look-up each, the same on every machine.

use std::f64::consts::TAU;

/// Quantiles of the standard normal distribution at the middles of equal shares.
#[derive(Clone, Debug)]
pub(super) struct NormalTable<const N: usize>(Box<[f32; N]>);

impl<const N: usize> NormalTable<N> {
    /// Sums the density over a fine grid and reads off where each share's middle is reached.
    pub(super) fn new() -> Self {
        let mut table = Box::new([0.0; N]);
        let (end, steps) = (6.0, 24_000);
        let width = 2.0 * end / f64::from(steps);
        let (mut sum, mut step) = (0.0, 0);
        for (share, value) in table.iter_mut().enumerate() {
            let wanted = (share as f64 + 0.5) / N as f64;
            loop {
                let middle = -end + (f64::from(step) + 0.5) * width;
                let slice = width * (-0.5 * middle * middle).exp() / TAU.sqrt();
                if sum + slice >= wanted || step == steps {
                    *value = (middle - 0.5 * width + (wanted - sum) / slice * width) as f32;
                    break;
                }
                sum += slice;
                step += 1;
            }
        }
        Self(table)
    }

    /// The number for random bits, of which the lowest are used. `N` must be a power of two.
    #[inline(always)]
    pub(super) fn get(&self, bits: u32) -> f32 {
        self.0[bits as usize & (N - 1)]
    }
}

#[cfg(test)]
mod tests {
    //! Contract: the table has the moments and quantiles of the standard normal distribution.
    use super::*;

    #[test]
    fn moments_and_quantiles_are_those_of_the_normal_distribution() {
        let table = NormalTable::<4096>::new();
        let values: Vec<f64> = table.0.iter().map(|&v| f64::from(v)).collect();
        let mean = values.iter().sum::<f64>() / 4096.0;
        let variance = values.iter().map(|v| v * v).sum::<f64>() / 4096.0;
        assert!(mean.abs() < 1e-4, "{mean}");
        assert!((variance - 1.0).abs() < 2e-3, "{variance}");
        // The 97.5 % quantile is 1.95996.
        let high = 0.5 * (values[3993] + values[3994 - 2]);
        assert!((high - 1.96).abs() < 0.01, "{high}");
        assert!(values.windows(2).all(|pair| pair[0] < pair[1]));
        assert_eq!(table.get(4096 + 7), table.get(7));
    }
}
