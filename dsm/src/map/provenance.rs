//! Who gave an object's votes: which backend said which word, how often, and in which frames.

use super::attributes::AttributeKind;
use crate::frame::FrameId;
use serde::{Deserialize, Serialize};

/// Most rows that one object keeps: about twice what a thing with a few rival names and colours has.
pub const MOST_CREDITS: usize = 48;

/// What a vote is about.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VoteSubject {
    /// The name.
    Name,
    /// An attribute and its key, for example appearance and `color`.
    Attribute(AttributeKind, String),
}

/// The votes of one backend for one word.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Credit {
    /// What the word is about.
    pub subject: VoteSubject,
    /// The word.
    pub word: String,
    /// The backend.
    pub source: String,
    /// Number of votes.
    pub votes: u32,
    /// Sum of their weights.
    pub weight: f32,
    /// The first frame with such a vote.
    pub first: FrameId,
    /// The last one.
    pub last: FrameId,
}

impl Credit {
    fn key(&self) -> (&VoteSubject, &str, &str) {
        (&self.subject, &self.word, &self.source)
    }
}

/// Where an object's votes come from. Frames are those of the run that made the map.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Sorted by subject, word and source.
    credits: Vec<Credit>,
    /// Votes whose rows had no place.
    forgotten: u32,
}

impl Provenance {
    /// Notes a vote.
    pub fn add(&mut self, subject: VoteSubject, word: &str, source: &str, weight: f32, frame: FrameId) {
        match self.credits.binary_search_by(|credit| credit.key().cmp(&(&subject, word, source))) {
            Ok(place) => {
                let credit = &mut self.credits[place];
                credit.votes = credit.votes.saturating_add(1);
                credit.weight += weight;
                (credit.first, credit.last) = (credit.first.min(frame), credit.last.max(frame));
            }
            Err(place) => {
                let (word, source) = (word.to_owned(), source.to_owned());
                self.credits
                    .insert(place, Credit { subject, word, source, votes: 1, weight, first: frame, last: frame });
                self.forget();
            }
        }
    }

    /// Takes over all rows of another object, which is the same thing.
    pub fn merge(&mut self, other: &Self) {
        self.forgotten = self.forgotten.saturating_add(other.forgotten);
        for theirs in &other.credits {
            match self.credits.binary_search_by(|credit| credit.key().cmp(&theirs.key())) {
                Ok(place) => {
                    let credit = &mut self.credits[place];
                    credit.votes = credit.votes.saturating_add(theirs.votes);
                    credit.weight += theirs.weight;
                    (credit.first, credit.last) = (credit.first.min(theirs.first), credit.last.max(theirs.last));
                }
                Err(place) => self.credits.insert(place, theirs.clone()),
            }
        }
        self.forget();
    }

    /// Drops the rows with the least votes, the one that was silent longest first, until all have a place.
    fn forget(&mut self) {
        while self.credits.len() > MOST_CREDITS {
            let least = (0..self.credits.len()).min_by_key(|i| (self.credits[*i].votes, self.credits[*i].last));
            let Some(least) = least else { return };
            self.forgotten = self.forgotten.saturating_add(self.credits.remove(least).votes);
        }
    }

    /// The rows, sorted by subject, word and source.
    pub fn credits(&self) -> &[Credit] {
        &self.credits
    }

    /// Votes whose rows had no place.
    pub fn forgotten(&self) -> u32 {
        self.forgotten
    }

    /// Whether nothing is known.
    pub fn is_empty(&self) -> bool {
        self.credits.is_empty()
    }

    /// Whether rows are as [`Self::add`] makes them: sorted, not too many, with finite weights.
    pub fn is_sound(&self) -> bool {
        self.credits.len() <= MOST_CREDITS
            && self.credits.iter().all(|credit| credit.weight.is_finite() && credit.first <= credit.last)
            && self.credits.windows(2).all(|pair| pair[0].key() < pair[1].key())
    }
}

#[cfg(test)]
mod tests {
    //! Contract: votes are counted for each word and backend with the frames they span, also through a merge, and the
    //! rows of an object are bounded: those with the least votes go.
    use super::*;

    #[test]
    fn votes_are_credited_and_bounded() {
        let color = || VoteSubject::Attribute(AttributeKind::Appearance, "color".into());
        let mut one = Provenance::default();
        one.add(VoteSubject::Name, "mug", "simulated", 0.5, FrameId(7));
        one.add(VoteSubject::Name, "mug", "simulated", 0.25, FrameId(9));
        one.add(VoteSubject::Name, "mug", "model", 1.0, FrameId(8));
        one.add(color(), "red", "knowledge", 1.0, FrameId(7));
        let rows: Vec<_> = one.credits().iter().map(|c| (c.word.as_str(), c.source.as_str(), c.votes)).collect();
        assert_eq!(rows, [("mug", "model", 1), ("mug", "simulated", 2), ("red", "knowledge", 1)]);
        let own = &one.credits()[1];
        assert_eq!((own.weight, own.first, own.last), (0.75, FrameId(7), FrameId(9)));
        let mut other = Provenance::default();
        other.add(VoteSubject::Name, "mug", "simulated", 0.5, FrameId(3));
        other.add(VoteSubject::Name, "cup", "simulated", 0.5, FrameId(4));
        one.merge(&other);
        assert_eq!(
            (one.credits()[0].word.as_str(), one.credits()[2].votes, one.credits()[2].first),
            ("cup", 3, FrameId(3))
        );
        for i in 0..200 {
            one.add(color(), &format!("shade {i:03}"), "knowledge", 1.0, FrameId(100 + i));
        }
        assert_eq!(one.credits().len(), MOST_CREDITS);
        assert!(one.credits().iter().any(|c| c.word == "mug" && c.votes == 3) && one.is_sound());
        let kept: u32 = one.credits().iter().map(|c| c.votes).sum();
        assert_eq!(kept + one.forgotten(), 206);
        let unsorted = Provenance { credits: one.credits.iter().rev().cloned().collect(), forgotten: 0 };
        assert!(!unsorted.is_sound());
    }
}
