//! Commands as people give them: verb, target, destination, and the parse of both.

use crate::ground::noun::Names;
use crate::ground::parse::{Attachment, parse_query};
use crate::ground::words::tokens_of;
use crate::ground::{Action, Article, Command, Entity, Noun, RelationTerm, Unparsed, parse_command};
use crate::knowledge::Knowledge;

/// The sentences of the apartment's episodes.
const EPISODES: &[(&str, Action, &str, &str)] = &[
    ("Bring the yellow mug to the computer desk", Action::Bring, "mug[yellow]", "computer desk"),
    (
        "Grasp the apple on the white shelf with white cabinet",
        Action::Grasp,
        "apple on(shelf[white] with(cabinet[white]))",
        "",
    ),
    ("Grasp the red apple on the table", Action::Grasp, "apple[red] on(table)", ""),
    ("Grasp the apple on the coffee table", Action::Grasp, "apple on(coffee table)", ""),
    ("Grasp the bottle between the mug and the vase", Action::Grasp, "bottle between(mug,vase)", ""),
    ("Grasp the bottle to the left of the vase", Action::Grasp, "bottle left_of(vase)", ""),
    ("Pick up the metal mug", Action::Grasp, "mug[metal]", ""),
    ("Grasp the mug closest to the kettle", Action::Grasp, "mug closest(kettle)", ""),
    ("Grasp the yellow mug", Action::Grasp, "mug[yellow]", ""),
    ("Navigate to the blue book", Action::Navigate, "book[blue]", ""),
    (
        "Navigate to the central room next to the computer desk",
        Action::Navigate,
        "@room{central} next_to(computer desk)",
        "",
    ),
    ("Navigate to the chair closest to the fridge", Action::Navigate, "chair closest(fridge)", ""),
    ("Go to the kitchen", Action::Navigate, "@kitchen", ""),
    ("Go to the red chair", Action::Navigate, "chair[red]", ""),
    ("Navigate to the room with the bed", Action::Navigate, "@room with(bed)", ""),
    ("Put the red cube on the coffee table", Action::Place, "cube[red]", "coffee table"),
    ("Put the cup on the nightstand on the bed", Action::Place, "cup on(nightstand)", "bed"),
    ("Grasp the purple mug", Action::Grasp, "mug[purple]", ""),
    ("Grasp the apple", Action::Grasp, "apple", ""),
];

/// Everyday wordings. The third column is the target as [`brief`] writes it; the fourth is the destination, before it
/// the region, or `back`.
const EVERYDAY: &[(&str, Action, &str, &str)] = &[
    ("could you fetch me the green mug", Action::Bring, "mug[green]", ""),
    ("Could you please bring me the can?", Action::Bring, "can", ""),
    ("take the tin", Action::Grasp, "tin", ""),
    ("grab the red can on the table", Action::Grasp, "can[red] on(table)", ""),
    ("pick up a can of soup", Action::Grasp, "a can", ""),
    ("pick the can up", Action::Grasp, "can", ""),
    ("can you grab the can next to the sink", Action::Grasp, "can next_to(sink)", ""),
    ("put it back", Action::Place, "", "back"),
    ("put the mug back", Action::Place, "mug", "back"),
    ("return the book", Action::Place, "book", "back"),
    ("put the mug back on the shelf", Action::Place, "mug", "shelf"),
    ("drive to the bathroom", Action::Navigate, "@bathroom", ""),
    ("go back to the kitchen please", Action::Navigate, "@kitchen", ""),
    ("return to the living room", Action::Navigate, "@living room", ""),
    ("go into the study", Action::Navigate, "@office", ""),
    ("take me to the room next to the kitchen", Action::Navigate, "@room next_to(@kitchen)", ""),
    ("head over to the white shelf", Action::Navigate, "shelf[white]", ""),
    ("grasp the mug that isn't red", Action::Grasp, "mug[!red]", ""),
    ("grasp the mug which is not red", Action::Grasp, "mug[!red]", ""),
    ("give me the non-red mug", Action::Bring, "mug[!red]", ""),
    ("bring me any mug other than the red one", Action::Bring, "a mug[!red]", ""),
    ("fetch the chair but not the one near the window", Action::Bring, "chair !near(window)", ""),
    ("get the cup that is not on the table", Action::Grasp, "cup !on(table)", ""),
    ("take the second book from the left", Action::Grasp, "book{leftmost#2}", ""),
    ("take the third from the right", Action::Grasp, "*{rightmost#3}", ""),
    ("pick up the leftmost bottle", Action::Grasp, "bottle{leftmost}", ""),
    ("hand me the largest of the boxes", Action::Bring, "boxes{largest}", ""),
    ("bring me one of the apples", Action::Bring, "a apples", ""),
    ("bring me an apple", Action::Bring, "a apple", ""),
    ("go left of the lamp", Action::Navigate, "lamp", "left_of"),
    ("go to the left of the lamp", Action::Navigate, "lamp", "left_of"),
    ("stand behind the sofa", Action::Navigate, "sofa", "behind"),
    ("drive in front of the tv", Action::Navigate, "tv", "in_front_of"),
    ("wait by the door", Action::Navigate, "door", ""),
    ("move next to the bed", Action::Navigate, "bed", "next_to"),
    ("put the cup to the right of the lamp", Action::Place, "cup", "right_of lamp"),
    ("place the apple next to the bowl", Action::Place, "apple", "next_to bowl"),
    ("put the ball under the table", Action::Place, "ball", "under table"),
    ("set the vase down in front of the mirror", Action::Place, "vase", "in_front_of mirror"),
    ("put it on the desk beside the laptop", Action::Place, "", "desk next_to(laptop)"),
    ("move the blue book to the coffee table", Action::Place, "book[blue]", "coffee table"),
    ("take the milk out of the fridge", Action::Grasp, "milk in(fridge)", ""),
    ("get the cup off the shelf", Action::Grasp, "cup on(shelf)", ""),
    ("take the book from the nightstand", Action::Grasp, "book on(nightstand)", ""),
    ("bring me a banana from the kitchen", Action::Bring, "a banana in(@kitchen)", ""),
    ("take the plate to the kitchen", Action::Bring, "plate", "@kitchen"),
    ("carry the box over to the bedroom", Action::Bring, "box", "@bedroom"),
    ("i want the banana", Action::Bring, "banana", ""),
    ("I need something to write with", Action::Bring, "a *[write]", ""),
    ("can i have something to drink from", Action::Bring, "a *[drink]", ""),
    ("I'd like the orange on the orange chair", Action::Bring, "orange on(chair[orange])", ""),
    ("robot, let's find the wooden bowl", Action::Find, "bowl[wood]", ""),
    ("where did I leave my phone", Action::Find, "phone", ""),
    ("where's the remote control?", Action::Find, "remote control", ""),
    ("please go ahead and get hold of the metal mug", Action::Grasp, "mug[metal]", ""),
    ("would you mind bringing me the small bowl", Action::Bring, "bowl[small]", ""),
    ("I want you to grab the glass on the counter", Action::Grasp, "glass on(counter)", ""),
    ("approach the desk by the window", Action::Navigate, "desk near(window)", ""),
    ("look for the keys under the sofa", Action::Find, "keys under(sofa)", ""),
    ("lift the heavy box without a lid", Action::Grasp, "box[heavy] !with(a lid)", ""),
    ("grab the lamp between the bed and the wardrobe", Action::Grasp, "lamp between(bed,wardrobe)", ""),
    ("grasp the bottle closest to the vase on the shelf", Action::Grasp, "bottle closest(vase on(shelf))", ""),
    ("get the mug nearest the sink", Action::Grasp, "mug closest(sink)", ""),
    ("bring me the mug nearest to me", Action::Bring, "mug{nearest}", ""),
    ("pick up the toy that lies on the floor", Action::Grasp, "toy on(floor)", ""),
    ("grasp the striped ceramic vase", Action::Grasp, "vase[striped,ceramic]", ""),
    ("grasp the vase made of glass", Action::Grasp, "vase[glass]", ""),
    ("fetch the cup farthest from the door", Action::Bring, "cup farthest(door)", ""),
    ("go to the chair in the corner", Action::Navigate, "chair{corner}", ""),
    ("go to the biggest room", Action::Navigate, "@room{largest}", ""),
];

/// An entity in one line: `noun[attributes]{selections} relation(anchors)`; `a` for any, `!` for not, `@` for a room,
/// `*` for any thing.
fn brief(entity: &Entity) -> String {
    let mut text = if entity.article == Article::Indefinite { "a ".to_owned() } else { String::new() };
    match &entity.noun {
        Noun::Thing(name) => text += name,
        Noun::Room(name) => text += &format!("@{name}"),
        Noun::Anything => text += "*",
    }
    let attributes: Vec<String> =
        entity.attributes.iter().map(|a| format!("{}{}", if a.negated { "!" } else { "" }, a.word)).collect();
    if !attributes.is_empty() {
        text += &format!("[{}]", attributes.join(","));
    }
    for selection in &entity.selections {
        let rank = if selection.rank > 1 { format!("#{}", selection.rank) } else { String::new() };
        text += &format!("{{{}{rank}}}", snake(&selection.order));
    }
    for RelationTerm { word, negated, anchors } in &entity.relations {
        let anchors: Vec<String> = anchors.iter().map(brief).collect();
        text += &format!(" {}{}({})", if *negated { "!" } else { "" }, snake(word), anchors.join(","));
    }
    text
}

fn snake(word: &impl serde::Serialize) -> String {
    serde_json::to_value(word).unwrap().as_str().unwrap().to_owned()
}

fn parse(text: &str) -> Result<Command, Unparsed> {
    parse_command(text, &Knowledge::embedded().unwrap())
}

fn check(cases: &[(&str, Action, &str, &str)]) {
    let knowledge = Knowledge::embedded().unwrap();
    let names = Names::of([].into_iter(), false);
    let understood = |words: &str| {
        let query = parse_query(&tokens_of(words), &knowledge, &names, Attachment::Nearest);
        query.map_or(String::new(), |query| brief(&query.target))
    };
    let mut wrong = Vec::new();
    for (text, action, target, destination) in cases {
        let command = match parse_command(text, &knowledge) {
            Ok(command) => command,
            Err(error) => {
                wrong.push(format!("{text}: {error}"));
                continue;
            }
        };
        let place = match (&command.destination, command.region, command.back) {
            (None, None, back) => if back { "back" } else { "" }.to_owned(),
            (None, Some(region), _) => snake(&region),
            (Some(words), None, _) => understood(words),
            (Some(words), Some(region), _) => format!("{} {}", snake(&region), understood(words)),
        };
        let found = (command.action, understood(&command.target), place);
        if found != (*action, (*target).to_owned(), (*destination).to_owned()) {
            wrong.push(format!("{text}: {found:?}"));
        }
    }
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), cases.len(), wrong.join("\n"));
}

#[test]
fn the_episodes_are_understood() {
    check(EPISODES);
}

#[test]
fn everyday_wordings_are_understood() {
    assert!(EVERYDAY.len() >= 60);
    check(EVERYDAY);
}

#[test]
fn ordinary_commands() {
    let cases = [
        (
            "Grasp the apple on the white shelf with white cabinet",
            Action::Grasp,
            "the apple on the white shelf with white cabinet",
            None,
        ),
        ("please pick up the red mug.", Action::Grasp, "the red mug", None),
        ("Navigate to the blue book", Action::Navigate, "the blue book", None),
        ("Could you go to the kitchen?", Action::Navigate, "the kitchen", None),
        ("put the apple on the table", Action::Place, "the apple", Some("the table")),
        ("Put the cup on the desk on the white shelf", Action::Place, "the cup on the desk", Some("the white shelf")),
        ("place the apple in the bowl in the kitchen", Action::Place, "the apple", Some("the bowl in the kitchen")),
        ("put it down on the table", Action::Place, "", Some("the table")),
        ("put the mug on the table next to the lamp", Action::Place, "the mug", Some("the table next to the lamp")),
        (
            "bring the mug next to the sink to the bedroom",
            Action::Bring,
            "the mug next to the sink",
            Some("the bedroom"),
        ),
        ("bring me the banana", Action::Bring, "the banana", None),
        ("fetch the ball to the left of the sofa", Action::Bring, "the ball to the left of the sofa", None),
        ("where is my phone", Action::Find, "my phone", None),
        ("go and get the apple", Action::Grasp, "the apple", None),
    ];
    for (text, action, target, destination) in cases {
        let command = parse(text).unwrap_or_else(|e| panic!("{text}: {e}"));
        assert_eq!(command.action, action, "{text}");
        assert_eq!(command.target, target, "{text}");
        assert_eq!(command.destination.as_deref(), destination, "{text}");
    }
    assert_eq!(parse("explore").unwrap().action, Action::Explore);
    assert_eq!(parse("look around").unwrap().action, Action::Explore);
}

#[test]
fn refusals_are_typed() {
    assert_eq!(parse(""), Err(Unparsed::Empty));
    assert_eq!(parse("\u{0}\u{7f}"), Err(Unparsed::Empty));
    assert!(matches!(parse("dance wildly"), Err(Unparsed::UnknownVerb { .. })));
    assert!(matches!(parse("grasp"), Err(Unparsed::NoTarget { .. })));
    assert!(matches!(parse("put the cup"), Err(Unparsed::NoDestination { .. })));
}
