//! Measurements that are heard of late.

use dsm::time::{Span, Stamp};
use std::collections::VecDeque;

/// Keeps measurements until they are heard of.
#[derive(Clone, Debug)]
pub(super) struct Delay<T> {
    latency: Span,
    /// The one that was heard of last, then those on their way.
    waiting: VecDeque<(Stamp, T)>,
}

impl<T: Clone> Delay<T> {
    /// Nothing is later than `first`, which is known from the beginning.
    pub(super) fn new(latency_s: f64, now: Stamp, first: T) -> Self {
        Self { latency: Span::from_s(latency_s), waiting: VecDeque::from([(now, first)]) }
    }

    /// Takes in what is measured now, instead of what was measured at the same moment, and forgets what was heard of before
    /// something newer.
    pub(super) fn measure(&mut self, now: Stamp, value: T) {
        match self.waiting.back_mut() {
            Some((stamp, last)) if *stamp == now => *last = value,
            _ => self.waiting.push_back((now, value)),
        }
        while self.waiting.get(1).is_some_and(|(stamp, _)| now - *stamp >= self.latency) {
            self.waiting.pop_front();
        }
    }

    /// The newest that has been heard of.
    pub(super) fn heard(&self) -> &T {
        // There is always one.
        &self.waiting[0].1
    }
}

#[cfg(test)]
mod tests {
    //! Contract: a measurement shows when its latency is over, and without a latency at once.
    use super::*;

    #[test]
    fn measurements_show_after_their_latency() {
        let heard = |latency_s: f64| -> Vec<i64> {
            let mut delay = Delay::new(latency_s, Stamp(0), 0);
            (1..=5)
                .map(|tick| {
                    delay.measure(Stamp(tick * 10_000_000), tick);
                    *delay.heard()
                })
                .collect()
        };
        assert_eq!(heard(0.0), [1, 2, 3, 4, 5]);
        assert_eq!(heard(0.02), [0, 0, 1, 2, 3]);
    }
}
