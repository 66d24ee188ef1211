//! The reference of the book, made from the program: every command from its own definition, every file format from its
//! schema. `cargo run --release -p scenarios --example reference` writes it; a test holds that it is up to date.

use clap::{Arg, ArgAction, Command, CommandFactory, ValueEnum};
use dsm_tasks::cli::{Cli, SchemaKind, schema_value};
use serde_json::{Map, Value};
use std::fmt::Write;

/// First line of each page.
const MADE: &str = "<!-- Made by `cargo run --release -p scenarios --example reference`. Do not edit. -->\n";

/// The pages, by their names in `docs/reference/`.
pub fn pages() -> Vec<(String, String)> {
    let mut pages = vec![("commands.md".to_owned(), commands())];
    for kind in SchemaKind::value_variants() {
        let name = kind.to_possible_value().map_or(String::new(), |value| value.get_name().to_owned());
        let page = schema_page(&name, &schema_value(*kind));
        pages.push((format!("{name}.md"), page));
    }
    pages
}

// Writing to a String cannot fail, which is why the results of `write!` are dropped throughout.

/// Every command with its arguments.
fn commands() -> String {
    let mut text = format!(
        "{MADE}# Commands\n\nWhat `dsm --help` and `dsm COMMAND --help` say, in one page. Results go to stdout, logs and \
         progress to stderr.\n"
    );
    let mut root = Cli::command();
    root.build();
    write_command(&mut text, &root, "dsm");
    text
}

fn write_command(text: &mut String, command: &Command, name: &str) {
    let subcommands: Vec<&Command> =
        command.get_subcommands().filter(|c| c.get_name() != "help" && !c.is_hide_set()).collect();
    let about = command.get_long_about().or(command.get_about()).map(ToString::to_string).unwrap_or_default();
    let _ = write!(text, "\n## {name}\n\n{}\n\n", sentence(&about));
    if subcommands.is_empty() {
        let usage = command.clone().render_usage().to_string();
        let usage = usage.trim_start_matches("Usage:").trim();
        // A command that is built below others names them all; the program's own name may differ.
        let _ = write!(text, "```text\n{usage}\n```\n\n");
    }
    let is_told = |arg: &&Arg| !matches!(arg.get_id().as_str(), "help" | "version") && !arg.is_hide_set();
    for arg in command.get_arguments().filter(is_told).filter(|arg| name == "dsm" || arg.get_id() != "verbose") {
        write_argument(text, arg);
    }
    for subcommand in subcommands {
        write_command(text, subcommand, &format!("{name} {}", subcommand.get_name()));
    }
}

fn write_argument(text: &mut String, arg: &Arg) {
    let names: Vec<String> = arg.get_value_names().into_iter().flatten().map(|name| format!("<{name}>")).collect();
    let takes_value = matches!(arg.get_action(), ArgAction::Set | ArgAction::Append);
    let value = if takes_value { names.join(" ") } else { String::new() };
    let mut called = String::new();
    if let Some(short) = arg.get_short() {
        let _ = write!(called, "-{short}, ");
    }
    match arg.get_long() {
        Some(long) => drop(write!(called, "--{long} {value}")),
        None => called.push_str(&value),
    }
    let help = arg.get_long_help().or(arg.get_help()).map(ToString::to_string).unwrap_or_default();
    let _ = write!(text, "- `{}`: {}", called.trim(), sentence(&help));
    let defaults: Vec<String> = arg.get_default_values().iter().map(|v| format!("`{}`", v.to_string_lossy())).collect();
    if takes_value && !defaults.is_empty() {
        let _ = write!(text, " Default {}.", defaults.join(", "));
    }
    text.push('\n');
    // Shells are many and say nothing.
    let values = if takes_value { arg.get_possible_values() } else { Vec::new() };
    for value in values.iter().filter(|value| !value.is_hide_set()) {
        let help = value.get_help().map(|help| format!(": {}", sentence(&help.to_string()))).unwrap_or_default();
        let _ = writeln!(text, "  - `{}`{help}", value.get_name());
    }
}

/// Help without a full stop at its end gets one; what Markdown would take for an element stays text.
fn sentence(help: &str) -> String {
    let line = help.split_whitespace().collect::<Vec<_>>().join(" ");
    let stop = if line.is_empty() || line.ends_with(['.', '!', '?']) { "" } else { "." };
    plain(&line) + stop
}

/// Angle brackets outside of code would be elements.
fn plain(text: &str) -> String {
    let parts = text.split('`').enumerate();
    let safe = parts.map(|(i, part)| if i % 2 == 0 { part.replace('<', "&lt;") } else { part.to_owned() });
    safe.collect::<Vec<_>>().join("`")
}

/// A file format: its fields, then what they are made of.
fn schema_page(name: &str, schema: &Value) -> String {
    let mut text = format!("{MADE}# Format: {name}\n\n{}\n", description(schema));
    let _ = write!(text, "\nThe same as a JSON schema: `dsm schema {name}`.\n");
    write_fields(&mut text, schema);
    for (name, definition) in schema["$defs"].as_object().into_iter().flatten() {
        let _ = write!(text, "\n## {name}\n\n{}\n", description(definition));
        write_fields(&mut text, definition);
        write_words(&mut text, definition);
    }
    text
}

fn description(schema: &Value) -> String {
    plain(&schema["description"].as_str().unwrap_or_default().split_whitespace().collect::<Vec<_>>().join(" "))
}

fn write_fields(text: &mut String, schema: &Value) {
    let Some(fields) = schema["properties"].as_object() else { return };
    let required: Vec<&str> = schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    text.push('\n');
    for (key, field) in fields {
        let must = if required.contains(&key.as_str()) { ", required" } else { "" };
        let default = match &field["default"] {
            Value::Null => String::new(),
            value => format!(", default `{value}`"),
        };
        let meaning = description(field);
        let colon = if meaning.is_empty() { "" } else { ": " };
        let _ = writeln!(text, "- **`{key}`** ({}{must}{default}){colon}{meaning}", kind_of(field));
    }
}

/// What a value is, in words; a definition of the same page is a link.
fn kind_of(field: &Value) -> String {
    if let Some(reference) = field["$ref"].as_str() {
        let name = reference.rsplit('/').next().unwrap_or(reference);
        return format!("[{name}](#{})", name.to_lowercase());
    }
    if let Some(choices) = field["anyOf"].as_array() {
        return choices.iter().map(kind_of).collect::<Vec<_>>().join(" or ");
    }
    let kind = match &field["type"] {
        Value::String(kind) => kind.clone(),
        Value::Array(kinds) => kinds.iter().filter_map(Value::as_str).collect::<Vec<_>>().join(" or "),
        _ if field["const"].is_string() => field["const"].to_string(),
        _ => "any".to_owned(),
    };
    let kind = match (&field["items"], &field["additionalProperties"]) {
        (items @ Value::Object(_), _) => format!("{kind} of {}", kind_of(items)),
        (_, values @ Value::Object(_)) => format!("{kind} of {}", kind_of(values)),
        _ => kind,
    };
    kind + &range(field)
}

fn range(field: &Value) -> String {
    // That a whole number is not negative says its type.
    let least = field["minimum"].as_f64().filter(|least| *least != 0.0 || field["maximum"].is_number());
    match (least, field["maximum"].as_f64()) {
        (Some(least), Some(most)) => format!(", {least} to {most}"),
        (Some(least), None) => format!(", at least {least}"),
        (None, Some(most)) => format!(", at most {most}"),
        (None, None) => String::new(),
    }
}

/// The words of an enum, and its kinds that hold fields.
fn write_words(text: &mut String, schema: &Value) {
    let choices = schema["oneOf"].as_array().or(schema["anyOf"].as_array());
    if let Some(choices) = choices {
        text.push('\n');
        for choice in choices {
            match choice["properties"].as_object() {
                Some(fields) => write_choice(text, fields, &description(choice)),
                None => write_word(text, choice),
            }
        }
    } else if schema["properties"].is_null() {
        let _ = write!(text, "\nIs {}.\n", kind_of(schema));
    }
}

fn write_word(text: &mut String, choice: &Value) {
    let words: Vec<String> = match (&choice["const"], choice["enum"].as_array()) {
        (Value::String(word), _) => vec![format!("`{word}`")],
        (_, Some(words)) => words.iter().filter_map(Value::as_str).map(|word| format!("`{word}`")).collect(),
        _ => vec![kind_of(choice)],
    };
    let meaning = description(choice);
    let colon = if meaning.is_empty() { "" } else { ": " };
    let _ = writeln!(text, "- {}{colon}{meaning}", words.join(", "));
}

fn write_choice(text: &mut String, fields: &Map<String, Value>, meaning: &str) {
    let fields: Vec<String> = fields.iter().map(|(key, field)| format!("`{key}` ({})", kind_of(field))).collect();
    let colon = if meaning.is_empty() { "" } else { ": " };
    let _ = writeln!(text, "- {}{colon}{meaning}", fields.join(", "));
}
