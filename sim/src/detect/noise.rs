//! How good the simulated detector is, and the draws behind its errors.
//!
//! Half of each rate is drawn once per object and view sector and stays, so that looking twice does not average it
//! out; the other half is drawn anew in every frame. Draws are keyed by the seed, the kind of error, the object's place
//! in the scene and the sector or frame: never by names or label ids.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Error rates of the simulated detector; the default is the preset `noisy`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DetectorNoise {
    /// Share of views in which a clearly visible object is missed; default 0.05, 0 to 1.
    pub miss_rate: f64,
    /// Masks below this many pixels are always missed; default 150, 0 and more.
    pub blind_below_px: usize,
    /// From here on only `miss_rate` counts; between the two the rate falls with the square; default 600, pixels.
    pub clear_from_px: usize,
    /// Share of masks that fall in two; default 0.03, 0 to 1.
    pub split_rate: f64,
    /// Share of masks that swallow a neighbour in the image at about the same depth; default 0.03, 0 to 1.
    pub merge_rate: f64,
    /// Share of names confused within a look-alike group; default 0.05, 0 to 1.
    pub confusion_rate: f64,
    /// Share of names that are another word for the same thing; default 0.2, 0 to 1.
    pub synonym_rate: f64,
    /// Largest error of a mask's border in pixels; the smallest is 1; default 3, 1 to 10.
    pub border_px: i32,
}

impl Default for DetectorNoise {
    fn default() -> Self {
        Self {
            miss_rate: 0.05,
            blind_below_px: 150,
            clear_from_px: 600,
            split_rate: 0.03,
            merge_rate: 0.03,
            confusion_rate: 0.05,
            synonym_rate: 0.2,
            border_px: 3,
        }
    }
}

impl DetectorNoise {
    /// Probability that a mask of this area is missed.
    pub fn miss_probability(&self, area_px: usize) -> f64 {
        if area_px < self.blind_below_px {
            return 1.0;
        }
        let span = self.clear_from_px.saturating_sub(self.blind_below_px).max(1) as f64;
        let clear = ((area_px - self.blind_below_px) as f64 / span).min(1.0);
        self.miss_rate + (1.0 - self.miss_rate) * (1.0 - clear).powi(2)
    }

    /// Probability that a thing is missed because the picture is dark, given how bright its brightest parts are (0 to 255):
    /// below 20 the sensor's noise is as large as what things differ by, from 60 on a picture is merely dim.
    pub fn miss_in_dark(&self, brightness: u8) -> f64 {
        const BLIND: f64 = 20.0;
        const DIM: f64 = 60.0;
        ((DIM - f64::from(brightness)) / (DIM - BLIND)).clamp(0.0, 1.0)
    }
}

/// Kind of a draw; each has its own random stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Event {
    Miss = 1,
    Split,
    Merge,
    Confusion,
    Synonym,
    Border,
    Score,
}

/// Streams of this crate's detector among all users of the seed.
const PERSISTENT_STREAM: u64 = 0x6465_7465_6374_0100;
const FRAME_STREAM: u64 = 0x6465_7465_6374_0200;

/// The draws for one object in one frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draws {
    pub seed: u64,
    pub frame: u64,
    /// Place of the object's body in the scene.
    pub body: u64,
    /// View sector, 0 to 11.
    pub sector: u64,
}

impl Draws {
    /// The stream of an event that stays for this object and sector.
    pub(super) fn persistent(&self, event: Event) -> ChaCha8Rng {
        keyed([self.seed, PERSISTENT_STREAM | event as u64, self.body, self.sector])
    }

    /// The stream of an event in this frame.
    pub(super) fn in_frame(&self, event: Event) -> ChaCha8Rng {
        keyed([self.seed, FRAME_STREAM | event as u64, self.body, self.frame])
    }

    /// Whether an event of the given rate happens; then the stream for its details.
    pub(super) fn find_event(&self, event: Event, rate: f64) -> Option<ChaCha8Rng> {
        // Two independent halves whose union has the full rate.
        let half = 1.0 - (1.0 - rate.clamp(0.0, 1.0)).sqrt();
        [self.persistent(event), self.in_frame(event)].into_iter().find_map(|mut stream| {
            let drawn: f64 = stream.random();
            (drawn < half || rate >= 1.0).then_some(stream)
        })
    }

    /// The persistent or the frame's stream, each half of the time for good per object and sector.
    pub(super) fn either(&self, event: Event) -> ChaCha8Rng {
        let mut persistent = self.persistent(event);
        if persistent.random::<bool>() { persistent } else { self.in_frame(event) }
    }
}

fn keyed(key: [u64; 4]) -> ChaCha8Rng {
    let mut seed = [0; 32];
    for (bytes, word) in seed.chunks_exact_mut(8).zip(key) {
        bytes.copy_from_slice(&word.to_le_bytes());
    }
    ChaCha8Rng::from_seed(seed)
}

#[cfg(test)]
mod tests {
    //! Contract: rates hold, half of each persists per object and sector, small masks are never seen.
    use super::*;

    #[test]
    fn the_rate_of_an_event_is_held_and_half_of_it_persists() {
        let rate = 0.05;
        let (mut hits, mut stays) = (0, 0);
        let (objects, frames) = (2000, 20);
        for body in 0..objects {
            let draws = |frame| Draws { seed: 7, frame, body, sector: 3 };
            let happened = (0..frames).filter(|f| draws(*f).find_event(Event::Miss, rate).is_some()).count();
            hits += happened;
            stays += usize::from(happened == frames as usize);
        }
        let share = hits as f64 / (objects * frames) as f64;
        assert!((share - rate).abs() < 0.01, "{share}");
        let persistent = stays as f64 / objects as f64;
        assert!((persistent - 0.025).abs() < 0.012, "{persistent}");
    }

    #[test]
    fn misses_rise_to_all_below_the_blind_limit() {
        let noise = DetectorNoise::default();
        assert_eq!((noise.miss_probability(149), noise.miss_probability(150)), (1.0, 1.0));
        assert!((noise.miss_probability(600) - 0.05).abs() < 1e-12 && noise.miss_probability(90_000) >= 0.05);
        assert!((150..600).all(|area| noise.miss_probability(area) > noise.miss_probability(area + 1)));
    }
}
