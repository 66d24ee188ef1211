//! Lower sides: what rests on something reaches down to it, though masks and depth end before.

use super::draft::Draft;
use super::tracks::Tracks;
use crate::map::{MapObject, ObjectId, ObjectState};
use nalgebra::Point3;

/// Largest gap between a lower side and what it rests on, beside what the views lost of the outline, metres.
const GAP_M: f64 = 0.03;
/// How far a lower side may reach into what it rests on, metres.
const SUNK_M: f64 = 0.02;
/// A thing stands out from what it rests on by at least this, metres.
const LEAST_M: f64 = 0.008;
/// Height of the floor, metres.
const FLOOR_M: f64 = 0.0;

/// Moves the lower sides of these objects down to (or up to) the floor or the surface that they rest on, if there is one
/// close by.
pub(super) fn settle(draft: &mut Draft, tracks: &Tracks, touched: &[ObjectId]) {
    for id in touched {
        let Some((object, track)) = draft.find(*id).zip(tracks.find(*id)) else { continue };
        let carriers = tracks.find_near(&track.aabb.grown(GAP_M)).into_iter().filter(|other| other != id);
        let carriers = carriers.filter_map(|other| draft.find(other).zip(tracks.find(other)));
        let carriers = carriers.filter(|(other, _)| may_carry(other, object));
        let heights = carriers.flat_map(|(_, other)| other.surfaces.iter().copied()).chain([FLOOR_M]);
        let Some(height) = find_rest_m(object, heights, track.lost_m) else { continue };
        if let Some(object) = draft.edit(*id) {
            let top = object.bounds.top_m();
            object.bounds.size.z = top - height;
            object.bounds.center.z = 0.5 * (top + height);
        }
    }
}

/// Whether the middle of a thing lies over another, which reaches lower and is not much smaller.
fn may_carry(other: &MapObject, object: &MapObject) -> bool {
    let (below, above) = (&other.bounds, &object.bounds);
    let middle = Point3::new(above.center.x, above.center.y, below.center.z);
    let areas = [below, above].map(|bounds| bounds.size.x * bounds.size.y);
    other.state == ObjectState::Stable
        && below.contains(&middle, 0.0)
        && below.bottom_m() < above.bottom_m()
        && 2.0 * areas[0] >= areas[1]
}

/// The height among these that the lower side is closest to, if it is close.
fn find_rest_m(object: &MapObject, heights: impl Iterator<Item = f64>, lost_m: f64) -> Option<f64> {
    let (bottom, top) = (object.bounds.bottom_m(), object.bounds.top_m());
    heights
        .filter(|height| (-SUNK_M..=GAP_M + lost_m).contains(&(bottom - height)) && top - height >= LEAST_M)
        .min_by(|a, b| (bottom - a).abs().total_cmp(&(bottom - b).abs()))
}
