//! Late answers of a slow model: taken in for the objects that they speak of, if these are still there.

use super::MapBuilder;
use crate::map::{Map, MapChange, MapObject, MapUpdate, ObjectId, Relation, RelationKind, RemovalReason, VoteSubject};
use crate::perceive::{Annotation, Remark, RemarkedRelation};
use std::collections::BTreeMap;

/// Merged objects that are remembered, the latest. A late answer is seconds old; in that time a frame merges a few.
const MOST_MERGED: usize = 4096;
/// Semantic relations that are remembered; the map holds some twenty relations per object.
const MOST_REMARKED: usize = 4096;
/// Distance up to which a semantic relation holds between two boxes, metres, as for those of the knowledge table.
const REACH_M: f64 = 1.5;

/// What late answers need to find their objects, and what of them outlives the next look at geometry.
#[derive(Default)]
pub(super) struct Late {
    /// Into which object one went.
    merged: BTreeMap<ObjectId, ObjectId>,
    /// Confidences of semantic relations that a model saw.
    remarked: BTreeMap<(ObjectId, ObjectId, RelationKind), f32>,
}

impl Late {
    /// Remembers the merges of an update.
    pub(super) fn follow(&mut self, changes: &[MapChange]) {
        for change in changes {
            if let MapChange::Remove(id, RemovalReason::MergedInto(into)) = change {
                self.merged.insert(*id, *into);
                self.rename(*id, *into);
            }
        }
        while self.merged.len() > MOST_MERGED {
            self.merged.pop_first();
        }
    }

    /// What was said of an object is true of the one that it went into.
    fn rename(&mut self, id: ObjectId, into: ObjectId) {
        let own = |(from, to, _): &(ObjectId, ObjectId, RelationKind)| *from == id || *to == id;
        let keys: Vec<_> = self.remarked.keys().filter(|key| own(key)).copied().collect();
        for key in keys {
            let Some(confidence) = self.remarked.remove(&key) else { continue };
            let new = |of: ObjectId| if of == id { into } else { of };
            let (from, to, kind) = (new(key.0), new(key.1), key.2);
            if from != to {
                self.remember(&RemarkedRelation { from, to, kind, confidence });
            }
        }
    }

    /// The object of the map that `id` has become; `None` when it is gone.
    fn find_survivor(&self, map: &Map, id: ObjectId) -> Option<ObjectId> {
        let mut current = id;
        // A chain of merges never returns to an object that is gone.
        for _ in 0..=self.merged.len() {
            if map.objects.contains_key(&current) {
                return Some(current);
            }
            current = *self.merged.get(&current)?;
        }
        None
    }

    /// The remarked relations that start at one of the objects, where `find` knows both and they are still together.
    pub(super) fn relations_from<'o>(
        &self,
        about: &[ObjectId],
        find: impl Fn(ObjectId) -> Option<&'o MapObject>,
    ) -> impl Iterator<Item = Relation> {
        let own = move |id: ObjectId| {
            let first = (id, ObjectId(0), RelationKind::On);
            self.remarked.range(first..).take_while(move |((from, _, _), _)| *from == id)
        };
        let found = about.iter().flat_map(move |id| own(*id)).filter(move |((from, to, _), _)| {
            find(*from).zip(find(*to)).is_some_and(|(from, to)| are_together(from, to))
        });
        found.map(|((from, to, kind), confidence)| Relation {
            from: *from,
            to: *to,
            kind: *kind,
            confidence: *confidence,
        })
    }

    fn remember(&mut self, relation: &RemarkedRelation) {
        let key = (relation.from, relation.to, relation.kind);
        let known = self.remarked.entry(key).or_insert(0.0);
        *known = known.max(relation.confidence.clamp(0.05, 1.0));
        while self.remarked.len() > MOST_REMARKED {
            self.remarked.pop_first();
        }
    }
}

/// Whether a relation is of the kinds that a model may state: geometry states the others.
fn is_semantic(kind: RelationKind) -> bool {
    matches!(kind, RelationKind::PartOf | RelationKind::UsedWith | RelationKind::StoredIn)
}

fn are_together(a: &MapObject, b: &MapObject) -> bool {
    let reach_m = REACH_M + 0.5 * (a.bounds.size.norm() + b.bounds.size.norm());
    (a.bounds.center - b.bounds.center).norm() <= reach_m
}

/// Adds relations that a model saw to those of geometry and knowledge; of two of one kind the surer one stays.
pub(super) fn join(relations: &mut Vec<Relation>, remarked: impl Iterator<Item = Relation>) {
    relations.extend(remarked);
    relations.sort_by(|a, b| {
        let key = |r: &Relation| (r.from, r.to, r.kind);
        key(a).cmp(&key(b)).then(b.confidence.total_cmp(&a.confidence))
    });
    relations.dedup_by_key(|r| (r.from, r.to, r.kind));
}

impl MapBuilder {
    /// The changes that follow from a late answer. It counts for the objects that it was asked about: those that went into
    /// others count for these, those that are gone for nothing. The caller applies the update before the next frame.
    pub fn annotate(&mut self, map: &Map, annotation: &Annotation) -> MapUpdate {
        let mut changes = Vec::new();
        let mut put: BTreeMap<ObjectId, MapObject> = BTreeMap::new();
        for remark in &annotation.remarks {
            let Some(id) = self.late.find_survivor(map, remark.object) else { continue };
            let Some(object) = put.get(&id).or_else(|| map.find_object(id)) else { continue };
            let mut object = object.clone();
            vote(&mut object, annotation, remark);
            put.insert(id, object);
        }
        changes.extend(put.into_values().map(|object| MapChange::Put(Box::new(object))));
        let mut about: Vec<ObjectId> = Vec::new();
        for relation in annotation.relations.iter().filter(|relation| is_semantic(relation.kind)) {
            let survivor = |id| self.late.find_survivor(map, id);
            let (Some(from), Some(to)) = (survivor(relation.from), survivor(relation.to)) else { continue };
            if from != to {
                self.late.remember(&RemarkedRelation { from, to, ..*relation });
                about.push(from);
            }
        }
        about.sort_unstable();
        about.dedup();
        if !about.is_empty() {
            let mut relations: Vec<Relation> =
                map.relations.iter().filter(|r| about.binary_search(&r.from).is_ok()).cloned().collect();
            join(&mut relations, self.late.relations_from(&about, |id| map.find_object(id)));
            changes.push(MapChange::Relate { about, relations });
        }
        MapUpdate { stamp: map.stamp, changes }
    }
}

fn vote(object: &mut MapObject, annotation: &Annotation, remark: &Remark) {
    let (source, frame) = (&*annotation.source, annotation.frame);
    if let Some((name, weight)) = remark.name.as_ref().filter(|(_, weight)| *weight > 0.0) {
        object.names.add(name, *weight);
        object.provenance.add(VoteSubject::Name, name, source, *weight, frame);
    }
    for vote in remark.attributes.iter().filter(|vote| vote.weight > 0.0) {
        object.attributes.add(vote.kind, vote.key, &vote.word, vote.weight);
        let subject = VoteSubject::Attribute(vote.kind, vote.key.to_owned());
        object.provenance.add(subject, &vote.word, source, vote.weight, frame);
    }
}

#[cfg(test)]
mod tests {
    //! Contract: a late answer counts for the objects that it was asked about. What they went into gets it, what is gone
    //! does not; only semantic relations are taken, and they hold as long as both things are together.
    use super::*;
    use crate::build::BuildConfig;
    use crate::frame::FrameId;
    use crate::geometry::OrientedBox;
    use crate::knowledge::Knowledge;
    use crate::map::{AttributeKind, Votes};
    use crate::perceive::AttributeVote;
    use crate::time::Stamp;
    use nalgebra::{Point3, UnitQuaternion, Vector3};
    use std::sync::Arc;

    fn object(id: u64, name: &str, x_m: f64) -> MapObject {
        let mut names = Votes::default();
        names.add(name, 1.0);
        let center = Point3::new(x_m, 0.0, 0.5);
        let bounds = OrientedBox { center, size: Vector3::repeat(0.3), rotation: UnitQuaternion::identity() };
        MapObject::given(ObjectId(id), names, bounds)
    }

    fn map_of(objects: impl IntoIterator<Item = MapObject>) -> Map {
        let mut map = Map::new(0.05);
        let changes = objects.into_iter().map(|object| MapChange::Put(Box::new(object))).collect();
        map.apply(MapUpdate { stamp: Stamp::default(), changes });
        map
    }

    fn builder() -> MapBuilder {
        MapBuilder::new(BuildConfig::default(), Arc::new(Knowledge::embedded().unwrap()))
    }

    fn remark(object: u64, name: &str) -> Remark {
        let vote =
            AttributeVote { kind: AttributeKind::Physical, key: "material", word: "ceramic".into(), weight: 2.0 };
        Remark { object: ObjectId(object), name: Some((name.into(), 2.0)), attributes: vec![vote] }
    }

    fn said(remarks: Vec<Remark>, relations: Vec<RemarkedRelation>) -> Annotation {
        Annotation { frame: FrameId(7), stamp: Stamp::default(), source: "model".into(), remarks, relations }
    }

    #[test]
    fn votes_reach_the_object_or_what_it_went_into() {
        let mut map = map_of([object(1, "cup", 0.0), object(2, "table", 1.0)]);
        let mut builder = builder();
        builder.late.follow(&[
            MapChange::Remove(ObjectId(5), RemovalReason::MergedInto(ObjectId(4))),
            MapChange::Remove(ObjectId(4), RemovalReason::MergedInto(ObjectId(1))),
            MapChange::Remove(ObjectId(6), RemovalReason::Absent),
        ]);
        let late = said(vec![remark(5, "mug"), remark(6, "vase"), remark(99, "lamp")], Vec::new());
        let update = builder.annotate(&map, &late);
        assert_eq!(update.changes.len(), 1, "what is gone gets nothing");
        map.apply(update);
        let cup = map.find_object(ObjectId(1)).unwrap();
        assert_eq!(cup.name(), "mug");
        assert_eq!(cup.attributes.find(AttributeKind::Physical, "material"), Some("ceramic"));
        let credits = cup.provenance.credits();
        assert!(credits.iter().all(|c| c.source == "model" && c.first == FrameId(7)) && credits.len() == 2);
        assert_eq!(map.find_object(ObjectId(2)).unwrap().name(), "table");
    }

    #[test]
    fn only_semantic_relations_of_things_that_are_together_are_taken() {
        let mut map = map_of([object(1, "cup", 0.0), object(2, "saucer", 0.4), object(3, "bed", 6.0)]);
        let mut builder = builder();
        let relation =
            |from, to, kind| RemarkedRelation { from: ObjectId(from), to: ObjectId(to), kind, confidence: 0.9 };
        let late = said(
            Vec::new(),
            vec![
                relation(1, 2, RelationKind::UsedWith),
                relation(1, 2, RelationKind::On),
                relation(1, 3, RelationKind::StoredIn),
                relation(2, 2, RelationKind::PartOf),
            ],
        );
        let update = builder.annotate(&map, &late);
        map.apply(update);
        let held: Vec<_> = map.relations.iter().map(|r| (r.from.0, r.to.0, r.kind)).collect();
        assert_eq!(held, [(1, 2, RelationKind::UsedWith)]);
        // The saucer went into another one: the relation goes with it.
        builder.late.follow(&[MapChange::Remove(ObjectId(2), RemovalReason::MergedInto(ObjectId(8)))]);
        let map = map_of([object(1, "cup", 0.0), object(8, "plate", 0.4)]);
        let held: Vec<_> = builder.late.relations_from(&[ObjectId(1)], |id| map.find_object(id)).collect();
        assert_eq!((held.len(), held[0].to), (1, ObjectId(8)));
    }

    #[test]
    fn of_two_relations_of_a_kind_the_surer_stays() {
        let edge =
            |confidence| Relation { from: ObjectId(1), to: ObjectId(2), kind: RelationKind::UsedWith, confidence };
        let mut relations = vec![edge(0.4)];
        join(&mut relations, [edge(0.8)].into_iter());
        assert_eq!(relations, [edge(0.8)]);
    }
}
