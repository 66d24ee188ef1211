//! What is wrong with a map, one line each, for whoever wants to mend it.

use super::matching::{Matching, Verdict};
use super::scene::{TrueScene, TrueThing};
use crate::geometry::OrientedBox;
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
                        "box {iou:.2}: {what}; truth {} at {}, {}; sides off by {} cm",
                        real.category,
                        place(&real.bounds.center),
                        size(&real.bounds.size),
                        list_offsets(&object.bounds, real)
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

/// How far each side lies outside (+) or inside (-) the true one, along the axes of the true box: low and high x, y, z, in
/// centimetres; behind the low and high side of what a frame has shown of the thing, in brackets.
fn list_offsets(bounds: &OrientedBox, thing: &TrueThing) -> String {
    let inside = |p: Point3<f64>| thing.bounds.rotation.inverse() * (p - thing.bounds.center);
    let [found, seen] = [
        bounds.corners().map(inside).to_vec(),
        thing.points.iter().filter(|p| p.seen).map(|p| inside(p.position.cast())).collect(),
    ]
    .map(|places: Vec<nalgebra::Vector3<f64>>| {
        let start = (nalgebra::Vector3::repeat(f64::INFINITY), nalgebra::Vector3::repeat(f64::NEG_INFINITY));
        places.iter().fold(start, |(low, high), p| (low.inf(p), high.sup(p)))
    });
    let side = |(low, high): &(nalgebra::Vector3<f64>, nalgebra::Vector3<f64>), axis: usize| {
        let half = 0.5 * thing.bounds.size[axis];
        format!("{:+.1} {:+.1}", -100.0 * (low[axis] + half), 100.0 * (high[axis] - half))
    };
    let axes = ["x", "y", "z"].iter().enumerate();
    let axes = axes.map(|(axis, name)| format!("{name} {} [{}]", side(&found, axis), side(&seen, axis)));
    axes.collect::<Vec<_>>().join(", ")
}
