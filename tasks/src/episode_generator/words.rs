//! Words that mean one object of a home and no other.

use super::home::Home;
use dsm::knowledge::Knowledge;

/// The nearest of several must be nearer than the next by this much, metres.
const NEARER_BY_M: f64 = 0.5;
/// Anchors farther than this from what they tell apart are of no help, metres.
const ANCHOR_REACH_M: f64 = 2.5;

/// Noun phrases without article that hold for the object alone, the shortest first. A wider name counts as a name: in a
/// home with an armchair, "the chair" is not the only chair.
pub(super) fn find_names(index: usize, home: &Home, knowledge: &Knowledge) -> Vec<String> {
    let object = &home.objects[index];
    let noun = object.category.as_str();
    let called = |other: usize| home.is_called(other, noun, knowledge);
    let colored = |other: usize| {
        let o = &home.objects[other];
        // What shows several colours may be called by any of them.
        o.mixed || o.color == object.color
    };
    let mut names = Vec::new();
    let mut add = |text: String, holds: &dyn Fn(usize) -> bool| {
        if home.is_only(index, holds) {
            names.push(text);
        }
    };
    add(noun.to_owned(), &called);
    if let Some(color) = &object.color {
        add(format!("{color} {noun}"), &|other| called(other) && colored(other));
    }
    if let Some(support) = object.support {
        let below = &home.objects[support].category;
        // What stands on a shelf may be said to stand on a bookshelf.
        let on_such = |other: usize| {
            let may_be = |on: usize| {
                home.is_called(on, below, knowledge) || home.is_called(support, &home.objects[on].category, knowledge)
            };
            home.objects[other].support.is_some_and(may_be)
        };
        add(format!("{noun} on the {below}"), &|other| called(other) && on_such(other));
        if let Some(color) = &object.color {
            add(format!("{color} {noun} on the {below}"), &|other| called(other) && colored(other) && on_such(other));
        }
    }
    // A room that shares its name with another is no help.
    if let Some(room) = object.room.as_ref().filter(|room| home.rooms.contains(room)) {
        let in_room = |other: usize| home.objects[other].room.as_ref() == Some(room);
        add(format!("{noun} in the {room}"), &|other| called(other) && in_room(other));
        if let Some(color) = &object.color {
            add(format!("{color} {noun} in the {room}"), &|other| called(other) && colored(other) && in_room(other));
        }
    }
    names.extend(find_nearest_names(index, home, knowledge));
    names
}

/// "mug closest to the kettle": the anchor is the only one of its kind, and nearer to this one than to all others.
fn find_nearest_names(index: usize, home: &Home, knowledge: &Knowledge) -> Vec<String> {
    let object = &home.objects[index];
    let noun = object.category.as_str();
    let rivals: Vec<usize> =
        (0..home.objects.len()).filter(|other| *other != index && home.is_called(*other, noun, knowledge)).collect();
    if rivals.is_empty() {
        return Vec::new();
    }
    let helps = |anchor: usize| {
        let a = &home.objects[anchor];
        let distance = |other: usize| (home.objects[other].at - a.at).norm();
        let own = distance(index);
        let unlike = a.category != object.category && Some(anchor) != object.support;
        let alone = home.is_only(anchor, &|other| home.is_called(other, &a.category, knowledge));
        unlike
            && !a.free
            && a.stands
            && own <= ANCHOR_REACH_M
            && alone
            && rivals.iter().all(|rival| distance(*rival) > own + NEARER_BY_M)
    };
    let anchors = (0..home.objects.len()).filter(|anchor| *anchor != index && helps(*anchor));
    // One such name is enough: the nearest anchor.
    let nearest = anchors.min_by(|a, b| {
        let distance = |anchor: &usize| (home.objects[*anchor].at - object.at).norm();
        distance(a).total_cmp(&distance(b))
    });
    nearest.map(|anchor| format!("{noun} closest to the {}", home.objects[anchor].category)).into_iter().collect()
}
