//! What happens to messages between the robot and whoever drives it: pictures are lost, all come late.

use dsm::time::Span;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::time::Duration;

/// Stream of what is lost and late among all that a seed draws.
const STREAM: u64 = 0x6169_7200;

/// How bad the connection is made.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Weather {
    /// Share of the images (colour and depth each) that are lost; 0 to 1.
    pub loss: f64,
    /// Each message comes later by a time between 0 and this.
    pub jitter: Span,
    /// Draws both.
    pub seed: u64,
}

/// Messages on their way.
pub(super) struct Air<M> {
    weather: Weather,
    drawn: u64,
    waiting: BTreeMap<(Duration, u64), M>,
}

/// What becomes of a message.
pub(super) enum Fate<M> {
    /// It is to be sent at once.
    Now(M),
    /// It waits, or is lost.
    Gone,
}

impl<M> Air<M> {
    pub(super) fn new(weather: Weather) -> Self {
        Self { weather, drawn: 0, waiting: BTreeMap::new() }
    }

    /// Gives a message to the air at the real time `now`; `is_image` for what can be lost.
    pub(super) fn pass(&mut self, now: Duration, message: M, is_image: bool) -> Fate<M> {
        self.drawn += 1;
        let mut rng = ChaCha8Rng::seed_from_u64(self.weather.seed);
        rng.set_stream(STREAM ^ self.drawn);
        let (chance, share): (f64, f64) = (rng.random(), rng.random());
        if is_image && chance < self.weather.loss {
            return Fate::Gone;
        }
        if self.weather.jitter.0 <= 0 {
            return Fate::Now(message);
        }
        let late = Duration::from_secs_f64(share * self.weather.jitter.as_s());
        self.waiting.insert((now + late, self.drawn), message);
        Fate::Gone
    }

    /// The next message whose time has come.
    pub(super) fn find_due(&mut self, now: Duration) -> Option<M> {
        let first = self.waiting.first_entry()?;
        (first.key().0 <= now).then(|| first.remove())
    }

    /// When the next message is due.
    pub(super) fn next_due(&self) -> Option<Duration> {
        self.waiting.keys().next().map(|(due, _)| *due)
    }
}

#[cfg(test)]
mod tests {
    //! Contract: as many images are lost as is said, nothing else is; nothing is late beyond the bound, and the same seed
    //! loses the same.
    use super::*;

    fn kept(seed: u64) -> Vec<u32> {
        let mut air = Air::new(Weather { loss: 0.2, jitter: Span(0), seed });
        (0..1000).filter(|n| matches!(air.pass(Duration::ZERO, *n, true), Fate::Now(_))).collect()
    }

    #[test]
    fn images_are_lost_by_share_and_by_seed() {
        assert!((750..850).contains(&kept(1).len()), "{}", kept(1).len());
        assert_eq!(kept(1), kept(1));
        assert_ne!(kept(1), kept(2));
        let mut air = Air::new(Weather { loss: 1.0, ..Weather::default() });
        assert!(matches!(air.pass(Duration::ZERO, 0, false), Fate::Now(0)));
        assert!(matches!(air.pass(Duration::ZERO, 0, true), Fate::Gone));
    }

    #[test]
    fn what_is_late_comes_within_the_bound() {
        let mut air = Air::new(Weather { jitter: Span(20_000_000), ..Weather::default() });
        for n in 0..100 {
            assert!(matches!(air.pass(Duration::from_secs(1), n, false), Fate::Gone));
        }
        assert!(air.next_due().is_some_and(|due| due >= Duration::from_secs(1)));
        assert_eq!(air.find_due(Duration::from_millis(999)), None);
        let halfway = std::iter::from_fn(|| air.find_due(Duration::from_millis(1010))).count();
        assert!((25..75).contains(&halfway), "{halfway}");
        assert_eq!(std::iter::from_fn(|| air.find_due(Duration::from_millis(1020))).count(), 100 - halfway);
        assert_eq!(air.next_due(), None);
    }
}
