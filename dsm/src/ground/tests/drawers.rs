//! Contract: what lies in a drawer is found by it, although the map lists furniture and no drawers; what was opened is closed
//! by "it" or by the name of its part.

use super::house::{ground, map_of, relate, thing};
use crate::ground::{Action, GroundingStatus, PartKind, PartPlace, Unparsed, parse_command};
use crate::knowledge::Knowledge;
use crate::map::{ObjectId, RelationKind};

#[test]
fn the_mug_in_the_drawer_is_the_one_inside_the_dresser() {
    let mut map = map_of([
        thing(1, "dresser", [0.0, 0.0, 0.4], [0.9, 0.5, 0.8]),
        thing(2, "table", [3.0, 0.0, 0.4], [1.2, 0.8, 0.8]),
        thing(3, "mug", [0.0, -0.05, 0.6], [0.08, 0.08, 0.1]),
        thing(4, "mug", [3.0, 0.0, 0.85], [0.08, 0.08, 0.1]),
    ]);
    relate(&mut map, &[(3, RelationKind::Inside, 1), (4, RelationKind::On, 2)]);
    for text in ["the mug in the drawer", "the mug in the dresser"] {
        let answer = ground(&map, text);
        assert_eq!(
            (answer.status, answer.object_id),
            (GroundingStatus::Found, Some(ObjectId(3))),
            "{text}: {answer:?}"
        );
    }
    assert_eq!(ground(&map, "the mug on the table").object_id, Some(ObjectId(4)));
}

#[test]
fn what_is_closed_may_be_what_was_opened() {
    let knowledge = Knowledge::embedded().unwrap();
    let parsed = |text: &str| parse_command(text, &knowledge);
    let bare = |text: &str| {
        let command = parsed(text).unwrap_or_else(|error| panic!("{text}: {error}"));
        assert_eq!((command.action, command.target.as_str()), (Action::Close, ""), "{text}");
        command.part.map(|part| (part.kind, part.place))
    };
    assert_eq!(bare("close it"), None);
    assert_eq!(bare("shut it again"), None);
    assert_eq!(bare("close the drawer"), Some((Some(PartKind::Drawer), None)));
    assert_eq!(bare("Close the left door"), Some((Some(PartKind::Door), Some(PartPlace::Left))));
    assert_eq!(parsed("close the drawer of the desk").unwrap().target, "the desk");
    assert!(matches!(parsed("close"), Err(Unparsed::NoTarget { .. })));
    let taken = parsed("bring me the mug from the drawer").unwrap();
    assert_eq!((taken.target.as_str(), taken.inside.as_deref()), ("the mug", Some("")));
}
