//! Which object of a map is which thing of the scene.
//!
//! Every stable object of the map gets one verdict. Its points (at most 300, evenly picked) belong to the thing whose true
//! surface is nearest, within 10 cm. A pair of object and thing is possible when at least 30 % of the object's points
//! belong to the thing; one optimal one-to-one assignment maximises the sum of box IoU and half that share. Names play
//! no part.
//!
//! - **matched**: assigned to a thing.
//! - **duplicate**: not assigned, although 30 % of its points belong to some thing: a second copy or a fragment.
//! - **ghost**: no thing holds 30 % of its points: nothing is there, or a jumble.
//! - **over-merged** (beside the verdict): it holds a second thing as well: a quarter of its points belong to another
//!   thing, or it is what covers a seen thing that no object was assigned to (half of that thing's seen surface has its
//!   nearest map point in this object, within 3 cm, and that point belongs to the thing).
//!
//! Each rate is a share of the stable objects of the map. Precision is the share of matched objects, recall the share of
//! the seen things that are matched.

use super::nearest::PointGrid;
use super::scene::TrueScene;
use crate::map::{Map, MapObject, ObjectId};
use nalgebra::Point3;
use pathfinding::kuhn_munkres::kuhn_munkres;
use pathfinding::matrix::Matrix;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Points of an object that are looked at.
const POINTS: usize = 300;
/// Farthest true surface that a point can belong to, metres.
const OWN_REACH_M: f32 = 0.10;
/// Share of the points from which an object can be a thing.
const OWN_SHARE: f64 = 0.3;
/// Share of the points from which a second thing is held as well.
const SECOND_SHARE: f64 = 0.25;
/// Farthest map point that covers a true surface, metres.
const COVER_REACH_M: f32 = 0.03;
/// Share of the seen surface from which a thing is covered.
const COVER_SHARE: f64 = 0.5;
/// True surface points of a thing that are looked at.
const SURFACE_POINTS: usize = 400;

/// What an object of the map is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// This thing.
    Matched(usize),
    /// Another copy or a fragment of this thing.
    Duplicate(usize),
    /// Nothing that is there.
    Ghost,
}

/// Objects of a map and things of a scene, side by side.
#[derive(Clone, Debug, PartialEq)]
pub struct Matching {
    /// The verdict on each stable object.
    pub verdicts: BTreeMap<ObjectId, Verdict>,
    /// The object of each thing, in the order of the scene.
    pub object_of: Vec<Option<ObjectId>>,
    /// Objects that hold a second thing, with that thing.
    pub over_merged: BTreeMap<ObjectId, usize>,
}

impl Matching {
    /// The thing that an object was assigned to.
    pub fn find_thing(&self, id: ObjectId) -> Option<usize> {
        match self.verdicts.get(&id) {
            Some(Verdict::Matched(thing)) => Some(*thing),
            _ => None,
        }
    }

    /// The thing that an object shows: the one it was assigned to, or of which it is another copy or a fragment.
    pub fn find_shown(&self, id: ObjectId) -> Option<usize> {
        match self.verdicts.get(&id) {
            Some(Verdict::Matched(thing) | Verdict::Duplicate(thing)) => Some(*thing),
            _ => None,
        }
    }
}

/// Picks at most `wanted` items, evenly.
pub(super) fn pick<T>(items: &[T], wanted: usize) -> impl Iterator<Item = &T> {
    items.iter().step_by(items.len().div_ceil(wanted).max(1))
}

/// Matches the stable objects of a map with the things of a scene.
pub fn match_objects(map: &Map, truth: &TrueScene) -> Matching {
    let surface = truth.objects.iter().zip(0u32..);
    let surface = surface.flat_map(|(thing, index)| thing.points.iter().map(move |p| (p.position, index)));
    let surface = PointGrid::new(0.05, surface);
    let objects: Vec<&MapObject> = map.stable_objects().collect();
    let shares: Vec<BTreeMap<usize, f64>> = objects.par_iter().map(|object| find_shares(object, &surface)).collect();

    let mut weights = Matrix::new(objects.len(), truth.objects.len() + objects.len(), 0i64);
    for (row, (object, shares)) in objects.iter().zip(&shares).enumerate() {
        for (thing, share) in shares.iter().filter(|(_, share)| **share >= OWN_SHARE) {
            let score = object.bounds.iou(&truth.objects[*thing].bounds) + 0.5 * share;
            weights[(row, *thing)] = (score * 1e6).round() as i64;
        }
    }
    let columns = if objects.is_empty() { Vec::new() } else { kuhn_munkres(&weights).1 };
    let mut matching = Matching {
        verdicts: BTreeMap::new(),
        object_of: vec![None; truth.objects.len()],
        over_merged: BTreeMap::new(),
    };
    for (row, column) in columns.into_iter().enumerate() {
        let id = objects[row].id;
        let most = shares[row].iter().max_by(|a, b| a.1.total_cmp(b.1)).filter(|(_, share)| **share >= OWN_SHARE);
        let verdict = match most {
            _ if column < truth.objects.len() && weights[(row, column)] > 0 => Verdict::Matched(column),
            Some((thing, _)) => Verdict::Duplicate(*thing),
            None => Verdict::Ghost,
        };
        if let Verdict::Matched(thing) = verdict {
            matching.object_of[thing] = Some(id);
        }
        matching.verdicts.insert(id, verdict);
    }
    matching.over_merged = find_over_merged(truth, &objects, &shares, &surface, &matching);
    matching
}

/// Share of the object's points that belong to each thing.
fn find_shares(object: &MapObject, surface: &PointGrid) -> BTreeMap<usize, f64> {
    let mut shares = BTreeMap::new();
    let places: Vec<Point3<f32>> = pick(&object.points, POINTS).map(|p| p.position).collect();
    let each = 1.0 / places.len().max(1) as f64;
    for place in &places {
        if let Some((thing, _)) = surface.find(place, OWN_REACH_M) {
            *shares.entry(thing as usize).or_insert(0.0) += each;
        }
    }
    shares
}

fn find_over_merged(
    truth: &TrueScene,
    objects: &[&MapObject],
    shares: &[BTreeMap<usize, f64>],
    surface: &PointGrid,
    matching: &Matching,
) -> BTreeMap<ObjectId, usize> {
    let mut found = BTreeMap::new();
    for (object, shares) in objects.iter().zip(shares) {
        let own = match matching.verdicts.get(&object.id) {
            Some(Verdict::Matched(thing) | Verdict::Duplicate(thing)) => *thing,
            _ => continue,
        };
        if let Some((second, _)) = shares.iter().find(|(thing, share)| **thing != own && **share >= SECOND_SHARE) {
            found.insert(object.id, *second);
        }
    }
    let points = objects.iter().zip(0u32..).flat_map(|(object, index)| object.points.iter().map(move |p| (p, index)));
    let (positions, owners): (Vec<Point3<f32>>, Vec<u32>) = points.map(|(p, index)| (p.position, index)).unzip();
    let map_points = PointGrid::new(0.03, positions.iter().copied().zip(0u32..));
    for (index, thing) in truth.objects.iter().enumerate() {
        if !thing.is_seen() || matching.object_of[index].is_some() {
            continue;
        }
        let seen: Vec<Point3<f32>> = thing.points.iter().filter(|p| p.seen).map(|p| p.position).collect();
        let mut covered: BTreeMap<u32, usize> = BTreeMap::new();
        let mut tested = 0;
        for place in pick(&seen, SURFACE_POINTS) {
            tested += 1;
            let Some((point, _)) = map_points.find(place, COVER_REACH_M) else { continue };
            let belongs = surface.find(&positions[point as usize], OWN_REACH_M).map(|(owner, _)| owner as usize);
            if belongs == Some(index) {
                *covered.entry(owners[point as usize]).or_default() += 1;
            }
        }
        for (object, count) in covered {
            let id = objects[object as usize].id;
            // Copies and fragments of the thing itself are counted as such.
            let of_itself = matches!(matching.verdicts.get(&id), Some(Verdict::Duplicate(thing)) if *thing == index);
            if count as f64 >= COVER_SHARE * tested as f64 && !of_itself {
                found.entry(id).or_insert(index);
            }
        }
    }
    found
}

/// Stable objects whose verdict passes.
pub(super) fn count(matching: &Matching, passes: impl Fn(&Verdict) -> bool) -> usize {
    matching.verdicts.values().filter(|verdict| passes(verdict)).count()
}
