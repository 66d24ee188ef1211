//! Merging duplicates and fragments.

use super::config::BuildConfig;
use super::draft::Draft;
use super::track::Track;
use super::tracks::Tracks;
use crate::geometry::OrientedBox;
use crate::map::{MapObject, ObjectId, RemovalReason};
use crate::perceive::{UNNAMED, cosine};

/// Common volume over the smaller box from which two objects of one name are one.
const SAME_NAME_OVERLAP: f64 = 0.5;
/// The same for two objects that were seen apart in two frames or more: a stack of plates is not one plate.
const SEEN_APART_OVERLAP: f64 = 0.75;
/// Intersection over union from which two objects in one place are one whatever their names (label flicker).
const SAME_PLACE_IOU: f64 = 0.5;
/// Text cosine from which names count as related, such as cabinet and wardrobe.
const RELATED_NAMES: f32 = 0.2;
/// Visual cosine asked of related names.
const SAME_LOOK: f32 = 0.7;

/// Share of the views of a thing, among those that look at another, whose masks must hold that one too.
const COVERED_SHARE: f64 = 0.15;
/// Frames with masks of both from which two things of one name are seen apart ...
const APART_FRAMES: usize = 3;
/// ... and their share of the frames that show the larger one: a detector tears far fewer masks in two.
const APART_SHARE: f64 = 0.3;
/// Views of the larger one that look at a piece beside it, at least, and the share of them whose masks must hold it.
const FRAGMENT_VIEWS: usize = 2;
const FRAGMENT_SHARE: f64 = 0.4;
/// Boxes closer than this touch, metres: the border that masks lose on both sides.
const TOUCHING_M: f64 = 0.03;
/// Sides below this are made thicker by as much before boxes are compared, metres.
const THIN_M: f64 = 0.05;

/// Merges every object of `changed` with what is the same thing. Each merge goes into the object with more
/// observations (the older one at a tie); an object that already went is never a source or a target again.
pub(super) fn merge_duplicates(config: &BuildConfig, draft: &mut Draft, tracks: &mut Tracks, changed: &[ObjectId]) {
    let mut open: Vec<ObjectId> = changed.iter().rev().copied().collect();
    while let Some(id) = open.pop() {
        let Some(track) = tracks.find(id) else { continue };
        let near = tracks.find_near(&track.aabb.grown(2.0 * config.pose_tolerance_m));
        let rival = near.into_iter().filter(|other| *other != id).find(|other| {
            match (draft.find(id), draft.find(*other), tracks.find(*other)) {
                (Some(a), Some(b), Some(other_track)) => is_same(config, a, track, b, other_track),
                _ => false,
            }
        });
        let Some(rival) = rival else { continue };
        let rank = |id: ObjectId| draft.find(id).map_or(0, |object| object.observations);
        let (keep, go) = match rank(id).cmp(&rank(rival)) {
            std::cmp::Ordering::Equal => (id.min(rival), id.max(rival)),
            std::cmp::Ordering::Greater => (id, rival),
            std::cmp::Ordering::Less => (rival, id),
        };
        if merge(config, draft, tracks, keep, go) {
            open.push(keep);
        }
    }
}

fn is_same(config: &BuildConfig, a: &MapObject, a_track: &Track, b: &MapObject, b_track: &Track) -> bool {
    let (a_box, b_box) = (thickened(&a.bounds), thickened(&b.bounds));
    let common = a_box.intersection_volume_m3(&b_box);
    let smaller = a_box.volume_m3().min(b_box.volume_m3()).max(1e-9);
    let overlap = common / smaller;
    let mutual = a.bounds.contains(&b.bounds.center, 0.0) && b.bounds.contains(&a.bounds.center, 0.0);
    let together = seen_together(a_track, b_track);
    // Having no name is no name to share.
    let unnamed = a.name() == UNNAMED || b.name() == UNNAMED;
    let same_name =
        !unnamed && (cosine(&a.text_feature, &b.text_feature) >= config.text_threshold || a.name() == b.name());
    // A thing put beside itself by a pose error is never seen together with itself. Of what a stored map brought along
    // that cannot be told before it is seen again.
    let both_seen = !a_track.seen.is_empty() && !b_track.seen.is_empty();
    if same_name && both_seen && together == 0 && is_beside(config, a_track, b_track) {
        return true;
    }
    if same_name && is_seen_apart(a, a_track, b, b_track) {
        return false;
    }
    if !mutual && overlap < SAME_NAME_OVERLAP {
        return same_name && is_fragment(a, a_track, b, b_track);
    }
    let text = cosine(&a.text_feature, &b.text_feature);
    let visual = cosine(&a.visual_feature, &b.visual_feature);
    let iou = common / (a_box.volume_m3() + b_box.volume_m3() - common).max(1e-9);
    if same_name {
        return together < 2 || overlap >= SEEN_APART_OVERLAP && shows_both(a, a_track, b, b_track);
    }
    // Two names for two masks of one frame: two things, however much one hides in the box of the other, unless other
    // masks show both as one.
    if together >= 1 && !(iou >= SAME_PLACE_IOU && shows_both(a, a_track, b, b_track)) {
        return false;
    }
    iou >= SAME_PLACE_IOU && visual >= config.visual_threshold
        || text >= RELATED_NAMES && visual >= SAME_LOOK && overlap >= SEEN_APART_OVERLAP
}

/// Whether the smaller one has a mask of its own in too many of the frames that show the larger one for a mask that falls
/// in two now and then.
fn is_seen_apart(a: &MapObject, a_track: &Track, b: &MapObject, b_track: &Track) -> bool {
    let a_is_part = a.bounds.volume_m3() < b.bounds.volume_m3();
    let (whole, part) = if a_is_part { (b_track, a_track) } else { (a_track, b_track) };
    let since = whole.seen.front().max(part.seen.front());
    let frames = whole.seen.iter().filter(|frame| Some(*frame) >= since).count();
    let together = seen_together(a_track, b_track);
    together >= APART_FRAMES && f64::from(together as u32) >= APART_SHARE * f64::from(frames as u32)
}

/// Whether the smaller one touches the larger one and lies in its masks: a piece that once had a mask of its own.
fn is_fragment(a: &MapObject, a_track: &Track, b: &MapObject, b_track: &Track) -> bool {
    let touching = a.bounds.intersection_volume_m3(&grown(&b.bounds)) > 0.0;
    let a_is_part = a.bounds.volume_m3() < b.bounds.volume_m3();
    let cover = || if a_is_part { b_track.window.cover(&a.points) } else { a_track.window.cover(&b.points) };
    touching && {
        let (share, views) = cover();
        views >= FRAGMENT_VIEWS && share >= FRAGMENT_SHARE
    }
}

fn grown(bounds: &OrientedBox) -> OrientedBox {
    OrientedBox { size: bounds.size.add_scalar(2.0 * TOUCHING_M), ..*bounds }
}

/// Whether masks of the larger one show the smaller one too: then this is a fragment, from masks that fell in two. Boards
/// of a shelf and drawers of a cabinet have masks of their own, which those of the whole leave out.
fn shows_both(a: &MapObject, a_track: &Track, b: &MapObject, b_track: &Track) -> bool {
    let a_is_part = a.bounds.volume_m3() < b.bounds.volume_m3();
    let (share, views) = if a_is_part { b_track.window.cover(&a.points) } else { a_track.window.cover(&b.points) };
    views == 0 || share >= COVERED_SHARE
}

/// The box with thin sides made thicker: two halves of a board lie in one plane only up to the noise.
fn thickened(bounds: &OrientedBox) -> OrientedBox {
    OrientedBox { size: bounds.size.map(|side| if side < THIN_M { side + THIN_M } else { side }), ..*bounds }
}

/// Whether two small things stand closer than their mean width plus 3 cm, at one height.
fn is_beside(config: &BuildConfig, a: &Track, b: &Track) -> bool {
    let (sides, other_sides) = (a.aabb.size(), b.aabb.size());
    let width = 0.25 * (sides.x + sides.y + other_sides.x + other_sides.y);
    let offset = a.aabb.center() - b.aabb.center();
    sides.max().max(other_sides.max()) < config.small_object_m
        && offset.xy().norm() < width + 0.03
        && offset.z.abs() < 0.5 * sides.z.max(other_sides.z)
}

/// In how many of the frames that both remember both were seen.
fn seen_together(a: &Track, b: &Track) -> usize {
    b.seen.iter().filter(|frame| a.seen.binary_search(frame).is_ok()).count()
}

fn merge(config: &BuildConfig, draft: &mut Draft, tracks: &mut Tracks, keep: ObjectId, go: ObjectId) -> bool {
    let Some(source) = draft.find(go).cloned() else { return false };
    if draft.find(keep).is_none() {
        return false;
    }
    let Some(gone) = tracks.remove(go) else { return false };
    let Some(target) = draft.edit(keep) else { return false };
    let merged = tracks.change(keep, |track| track.absorb(config, target, gone, &source));
    if merged.is_none() {
        return false;
    }
    draft.remove(go, RemovalReason::MergedInto(keep));
    true
}

#[cfg(test)]
mod tests {
    //! Contract: two of one name that mostly have masks of their own stay two, however much their boxes share; what had one
    //! of its own in a few frames is a torn mask.
    use super::*;
    use crate::frame::FrameId;
    use crate::map::{MapPoint, ObjectState};
    use crate::perceive::{KnowledgeTextEncoder, TextEncoder};
    use crate::time::Stamp;
    use nalgebra::{Point3, Vector3};
    use std::sync::Arc;

    fn drawer(id: u64, height_m: f64, frames: impl Iterator<Item = u64>) -> (MapObject, Track) {
        let side = |i: u16| 0.02 * f32::from(i);
        let front = (0..20).flat_map(|y| (0..20).map(move |z| (y, z)));
        let scale = height_m as f32 / 0.4;
        let points = front.map(|(y, z)| Point3::new(0.0, side(y), 0.1 + scale * side(z)));
        let points: Vec<MapPoint> = points.map(|position| MapPoint { position, color: [9; 3] }).collect();
        let center = Point3::new(0.2, 0.2, 0.1 + 0.5 * height_m);
        let mut object = MapObject {
            id: ObjectId(id),
            state: ObjectState::Stable,
            names: Default::default(),
            points,
            bounds: OrientedBox { center, size: Vector3::new(0.4, 0.4, height_m), rotation: Default::default() },
            attributes: Default::default(),
            visual_feature: vec![1.0],
            provenance: Default::default(),
            text_feature: KnowledgeTextEncoder::new(Arc::new(crate::knowledge::Knowledge::embedded().unwrap()))
                .encode("drawer"),
            room: None,
            observations: 9,
            first_seen: Stamp::default(),
            last_seen: Stamp::default(),
        };
        object.names.add("drawer", 1.0);
        let mut track = Track::from_object(&BuildConfig::default(), &object);
        track.seen = frames.map(FrameId).collect();
        (object, track)
    }

    #[test]
    fn drawers_of_one_chest_stay_two() {
        let config = BuildConfig::default();
        let (whole, whole_track) = drawer(0, 0.4, 0..40);
        // The upper drawer, whose box the lower one has come to hold, has its own mask in every other frame.
        let (part, part_track) = drawer(1, 0.2, (0..40).step_by(2));
        assert!(!is_same(&config, &whole, &whole_track, &part, &part_track));
        // A mask that was torn in two of forty frames is no second drawer.
        let (piece, piece_track) = drawer(1, 0.2, [7, 20].into_iter());
        assert!(is_same(&config, &whole, &whole_track, &piece, &piece_track));
    }
}
