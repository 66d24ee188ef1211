//! Whether there is light to see by, and how long one waits for it.

use dsm::frame::RgbdFrame;
use dsm::time::{Span, Stamp};

/// A picture whose brightest twentieth is darker than this shows nothing, of 255: 2 % of what white paper gives in light.
const DARK: u8 = 40;
/// So long one waits for light in all; who it does not come back to goes on with what is known and with depth.
const PATIENCE: Span = Span(60_000_000_000);

/// Light as the head camera has it.
#[derive(Clone, Debug)]
pub(crate) struct Light {
    dark_since: Option<Stamp>,
    patience: Span,
    last: Stamp,
}

impl Default for Light {
    fn default() -> Self {
        Self { dark_since: None, patience: PATIENCE, last: Stamp::default() }
    }
}

impl Light {
    /// Looks at a frame.
    pub(crate) fn note(&mut self, frame: &RgbdFrame) {
        let is_dark = brightness(frame).is_some_and(|level| level < DARK);
        if let (true, Some(_)) = (is_dark, self.dark_since) {
            self.patience = Span((self.patience.0 - (frame.stamp - self.last).0).max(0));
        }
        self.last = frame.stamp;
        self.dark_since = is_dark.then(|| self.dark_since.unwrap_or(frame.stamp));
    }

    /// Whether it is dark, and waiting for light is not in vain yet.
    pub(crate) fn is_awaited(&self) -> bool {
        self.dark_since.is_some() && self.patience.0 > 0
    }
}

/// The level that a twentieth of the picture is brighter than; `None` without a picture.
fn brightness(frame: &RgbdFrame) -> Option<u8> {
    const EVERY: usize = 61;
    let mut greens: Vec<u8> = frame.color.iter().step_by(EVERY).map(|[_, green, _]| *green).collect();
    let rank = greens.len().checked_sub(greens.len().div_ceil(20).max(1))?;
    Some(*greens.select_nth_unstable(rank).1)
}

#[cfg(test)]
mod tests {
    //! Contract: a black picture is dark, a dark thing in a lit room is not; patience ends and is not given back.
    use super::*;
    use crate::picture::tests::small_frame;

    fn frame(at_s: f64, level: impl Fn(usize) -> u8) -> RgbdFrame {
        let mut frame = small_frame();
        frame.stamp = Stamp::from_s(at_s);
        frame.color = (0..6100).map(|pixel| [level(pixel); 3]).collect();
        frame
    }

    #[test]
    fn one_waits_in_the_dark_but_not_for_ever() {
        let mut light = Light::default();
        light.note(&frame(0.0, |pixel| if pixel > 5000 { 180 } else { 5 }));
        assert!(!light.is_awaited(), "something is lit");
        light.note(&frame(0.2, |_| 12));
        assert!(light.is_awaited());
        light.note(&frame(40.0, |_| 12));
        light.note(&frame(40.2, |_| 150));
        assert!(!light.is_awaited(), "the light is back");
        light.note(&frame(50.0, |_| 12));
        light.note(&frame(65.0, |_| 12));
        assert!(light.is_awaited(), "55 s so far");
        light.note(&frame(75.0, |_| 12));
        assert!(!light.is_awaited(), "patience ends");
    }
}
