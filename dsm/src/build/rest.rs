//! Lower sides: what rests on something reaches down to it, though masks and depth end before.

use super::draft::Draft;
use super::tracks::Tracks;
use crate::geometry::OrientedBox;
use crate::map::{MapObject, ObjectId, ObjectState};
use nalgebra::Point3;

/// Largest gap between a lower side and what it rests on, beside what the views lost of the outline: in metres, and what a
/// metre of the shorter side adds. Of a pillow on a bed the upper face shows, of a bottle all down to its foot.
const GAP: (f64, f64) = (0.02, 0.15);
/// No gap is larger, metres.
const GAP_MAX_M: f64 = 0.08;
/// How far a lower side may reach into what it rests on, metres.
const SUNK_M: f64 = 0.02;
/// A thing stands out from what it rests on by at least this, metres.
const LEAST_M: f64 = 0.01;
/// Height of the floor, metres.
const FLOOR_M: f64 = 0.0;

/// Moves the lower sides of these objects down to (or up to) the floor or the surface that they rest on, if there is one
/// close by.
pub(super) fn settle(draft: &mut Draft, tracks: &Tracks, touched: &[ObjectId]) {
    for id in touched {
        let Some((object, track)) = draft.find(*id).zip(tracks.find(*id)) else { continue };
        let carriers = tracks.find_near(&track.aabb.grown(GAP_MAX_M)).into_iter().filter(|other| other != id);
        let carriers = carriers.filter_map(|other| draft.find(other).zip(tracks.find(other)));
        let carriers = carriers.filter(|(other, _)| may_carry(other, object));
        let heights = carriers.flat_map(|(_, other)| other.surfaces.iter().copied()).chain([FLOOR_M]);
        let Some(height) = find_rest_m(&object.bounds, heights, track.lost_m) else { continue };
        if let Some(object) = draft.edit(*id) {
            let top = object.bounds.top_m().max(height + LEAST_M);
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
fn find_rest_m(bounds: &OrientedBox, heights: impl Iterator<Item = f64>, lost_m: f64) -> Option<f64> {
    let (bottom, top) = (bounds.bottom_m(), bounds.top_m());
    let gap_m = (GAP.0 + GAP.1 * bounds.size.xy().min()).min(GAP_MAX_M) + lost_m;
    heights
        .filter(|height| (-SUNK_M..=gap_m).contains(&(bottom - height)) && top > height - LEAST_M)
        .min_by(|a, b| (bottom - a).abs().total_cmp(&(bottom - b).abs()))
}

#[cfg(test)]
mod tests {
    //! Contract: a thing reaches down to what is close below it, the closest first; what hangs stays where it is.
    use super::*;
    use crate::geometry::Aabb;
    use nalgebra::Vector3;

    fn find(side_m: f64, bottom_m: f64, top_m: f64, heights: &[f64]) -> Option<f64> {
        let half = Vector3::new(0.5 * side_m, 0.5 * side_m, 0.0);
        let corner = |z: f64| Point3::new(0.0, 0.0, z);
        let bounds = Aabb { min: corner(bottom_m) - half, max: corner(top_m) + half };
        find_rest_m(&bounds.into(), heights.iter().copied(), 0.005)
    }

    #[test]
    fn lower_sides_reach_what_is_close_below() {
        assert_eq!(find(0.08, 0.752, 0.85, &[0.0, 0.74, 0.30]), Some(0.74));
        assert_eq!(find(0.08, 0.80, 0.90, &[0.0, 0.74]), None, "a bottle shows down to its foot");
        assert_eq!(find(0.40, 0.80, 0.83, &[0.0, 0.74]), Some(0.74), "of a pillow the upper face shows");
        assert_eq!(find(0.60, 1.30, 1.70, &[0.0, 0.74]), None, "a picture hangs");
        assert_eq!(find(1.50, -0.006, 0.012, &[0.0]), Some(0.0), "a rug begins at the floor");
    }
}
