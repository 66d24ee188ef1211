//! The names of all items, each distinct one once: what is asked of a name is asked once, however many items bear it.

use crate::map::MapObject;
use std::collections::BTreeMap;

/// Names by number, and who bears them.
pub(super) struct SpokenNames<'a> {
    /// Each name that was voted for, in order of appearance.
    pub(super) all: Vec<&'a str>,
    /// The most voted name by item, as a place in `all`; items without votes bear the empty name.
    pub(super) winners: Vec<usize>,
    /// Votes of all items, one item after the other: the name's place in `all`, and the weight.
    votes: Vec<(usize, f32)>,
    /// Where the votes of an item end.
    ends: Vec<usize>,
}

impl<'a> SpokenNames<'a> {
    /// The names of these objects.
    pub(super) fn of(objects: impl Iterator<Item = &'a MapObject>) -> Self {
        let mut numbers: BTreeMap<&str, usize> = BTreeMap::new();
        let mut spoken = Self { all: Vec::new(), winners: Vec::new(), votes: Vec::new(), ends: Vec::new() };
        for object in objects {
            let all = &mut spoken.all;
            let mut number = |name: &'a str| {
                *numbers.entry(name).or_insert_with(|| {
                    all.push(name);
                    all.len() - 1
                })
            };
            let start = spoken.votes.len();
            spoken.votes.extend(object.names.iter().map(|(name, weight)| (number(name), weight)));
            // As `Votes::find_winner`: the first of those with most votes.
            let own = spoken.votes[start..].iter().copied();
            let winner = own.reduce(|best, vote| if vote.1 > best.1 { vote } else { best });
            spoken.winners.push(winner.map_or_else(|| number(""), |(name, _)| name));
            spoken.ends.push(spoken.votes.len());
        }
        spoken
    }

    /// For each item its votes: the name's place in `all`, and the weight.
    pub(super) fn votes(&self) -> impl Iterator<Item = &[(usize, f32)]> {
        let starts = [0].into_iter().chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, end)| &self.votes[start..*end])
    }

    /// The distinct names that win some item's votes.
    pub(super) fn winning(&self) -> impl Iterator<Item = &'a str> {
        let mut wins = vec![false; self.all.len()];
        self.winners.iter().for_each(|name| wins[*name] = true);
        self.all.iter().zip(wins).filter(|(_, wins)| *wins).map(|(name, _)| *name)
    }
}

#[cfg(test)]
mod tests {
    //! Contract: names, winners and votes are those of the objects.
    use super::*;
    use crate::ground::tests::house::{map_of, thing};

    #[test]
    fn names_are_those_of_the_objects() {
        let mut map = map_of([
            thing(1, "table", [2.0, 0.0, 0.375], [1.4, 0.8, 0.75]),
            thing(2, "apple", [2.2, 0.1, 0.79], [0.08, 0.08, 0.08]),
            thing(3, "table", [2.0, 4.0, 0.4], [2.0, 0.9, 0.8]),
            thing(4, "lamp", [2.0, 4.0, 0.4], [2.0, 0.9, 0.8]),
        ]);
        let mut votes = crate::map::Votes::default();
        for (name, weight) in [("orange", 3.0), ("apple", 3.0), ("ball", 1.0)] {
            votes.add(name, weight);
        }
        let mut objects: Vec<MapObject> = map.stable_objects().cloned().collect();
        objects[1].names = votes;
        objects[3].names = crate::map::Votes::default();
        let spoken = SpokenNames::of(objects.iter());
        for ((object, winner), votes) in objects.iter().zip(&spoken.winners).zip(spoken.votes()) {
            assert_eq!(object.name(), spoken.all[*winner]);
            let named: Vec<_> = votes.iter().map(|(name, weight)| (spoken.all[*name], *weight)).collect();
            assert_eq!(object.names.iter().collect::<Vec<_>>(), named);
        }
        assert_eq!(spoken.winning().collect::<Vec<_>>(), ["table", "apple", ""]);
        map.objects.clear();
        assert_eq!(SpokenNames::of(map.stable_objects()).winning().count(), 0);
    }
}
