//! The rows of `dsm bench` about map updates: what a frame costs in maps of several sizes.

use super::bench::Row;
use crate::assemble::knowledge;
use dsm::build::{BuildConfig, Carrier, MapBuilder};
use dsm::frame::{FrameId, RgbdFrame};
use dsm::map::{Map, copy_beside};
use dsm::perceive::Detections;
use dsm::time::{Span, Stamp};

/// Frames of the drive that are kept.
pub(super) const KEPT_FRAMES: usize = 40;
/// Updates that are timed in each map, after as many frames as are kept.
const UPDATES: usize = 200;
/// Between two frames.
const PERIOD: Span = Span(200_000_000);

/// A frame with all that mapping asks for.
pub(super) struct SeenFrame {
    pub(super) frame: RgbdFrame,
    pub(super) detections: Detections,
    pub(super) carrier: Carrier,
}

/// What a robot saw while it turned on the spot.
pub(super) struct Drive {
    pub(super) map: Map,
    /// The last frames, in their order.
    pub(super) frames: Vec<SeenFrame>,
}

/// Maps the kept frames again, there and back, into the map of the drive and into maps of 500 and 10 000 objects: the drive's with copies beside it.
pub(super) fn measure_updates(drive: &Drive, rows: &mut Vec<Row>) -> anyhow::Result<()> {
    let sizes = [
        (0, ["map update, map of the drive, median", "map update, map of the drive, p99"]),
        (500, ["map update, 500 objects, median", "map update, 500 objects, p99"]),
        (10_000, ["map update, 10 000 objects, median", "map update, 10 000 objects, p99"]),
    ];
    if drive.frames.is_empty() {
        return Ok(());
    }
    for (objects, names) in sizes {
        let mut map = drive.map.clone();
        map.apply(copy_beside(&drive.map, objects));
        let mut builder = MapBuilder::new(BuildConfig::default(), knowledge()?);
        let mut times_ms: Vec<f64> = Vec::new();
        let count = drive.frames.len();
        for number in 0..count + UPDATES {
            let turn = number % (2 * count);
            let seen = &drive.frames[turn.min(2 * count - 1 - turn)];
            let id = FrameId(1_000_000 + number as u64);
            let stamp = Stamp(map.stamp.0 + PERIOD.0);
            let frame = RgbdFrame { id, stamp, ..seen.frame.clone() };
            let detections = Detections { frame: id, items: seen.detections.items.clone() };
            // Wall time is what this command is for.
            #[expect(clippy::disallowed_methods)]
            let begin = std::time::Instant::now();
            let update = builder.observe(&map, &frame, &detections, &seen.carrier);
            map.apply(update);
            if number >= count {
                times_ms.push(1e3 * begin.elapsed().as_secs_f64());
            }
        }
        times_ms.sort_by(f64::total_cmp);
        for (what, share) in names.into_iter().zip([0.5, 0.99]) {
            let value = times_ms[(share * times_ms.len() as f64) as usize];
            let real_time_factor = Some(1e3 * PERIOD.as_s() / value.max(1e-9));
            rows.push(Row { what, value, unit: "ms", count: times_ms.len(), real_time_factor });
        }
    }
    Ok(())
}
