//! What is wrong with a map, one line each, for whoever wants to mend it.

use super::matching::{Matching, Verdict};
use super::scene::TrueScene;
use crate::map::Map;
use nalgebra::Point3;

/// Below this a box counts as poor.
const POOR_IOU: f64 = 0.5;

pub(super) fn list(map: &Map, truth: &TrueScene, matching: &Matching) -> Vec<String> {
    let place = |p: &Point3<f64>| format!("({:.2}, {:.2}, {:.2})", p.x, p.y, p.z);
    let size = |s: &nalgebra::Vector3<f64>| format!("{:.2} x {:.2} x {:.2} m", s.x, s.y, s.z);
    let mut lines = Vec::new();
    for object in map.stable_objects() {
        let (id, name, center) = (object.id.0, object.name(), place(&object.bounds.center));
        let what =
            format!("{name} {id} at {center}, {}, {} observations", size(&object.bounds.size), object.observations);
        match matching.verdicts.get(&object.id) {
            Some(Verdict::Ghost) => lines.push(format!("ghost: {what}")),
            Some(Verdict::Duplicate(thing)) => {
                let real = &truth.objects[*thing];
                lines.push(format!("duplicate: {what}; of {} {}", real.category, size(&real.bounds.size)));
            }
            Some(Verdict::Matched(thing)) => {
                let real = &truth.objects[*thing];
                let iou = object.bounds.iou(&real.bounds);
                if iou < POOR_IOU {
                    lines.push(format!(
                        "box {iou:.2}: {what}; truth {} at {}, {}",
                        real.category,
                        place(&real.bounds.center),
                        size(&real.bounds.size)
                    ));
                }
            }
            None => {}
        }
        if let Some(second) = matching.over_merged.get(&object.id) {
            let second = &truth.objects[*second];
            lines.push(format!("over-merge: {what}; holds {} at {}", second.category, place(&second.bounds.center)));
        }
    }
    for (thing, _) in
        truth.objects.iter().zip(&matching.object_of).filter(|(t, object)| t.is_seen() && object.is_none())
    {
        lines.push(format!(
            "missed: {} at {}, {}, seen in {} frames",
            thing.category,
            place(&thing.bounds.center),
            size(&thing.bounds.size),
            thing.frames_seen
        ));
    }
    lines.sort();
    lines
}
