//! Commands that the documentation tells people to type, held against what the program takes.

use clap::{Command, CommandFactory};
use dsm_tasks::cli::Cli;

/// Separates commands on a line.
const SEPARATORS: [&str; 5] = ["&&", "||", "|", ";", "&"];

/// The commands on a line, each as its words. What stands in brackets is optional and is tried as if it were given;
/// comments and redirections are left out.
///
/// Fails when quotes do not close.
pub fn words(line: &str) -> Result<Vec<Vec<String>>, String> {
    let words = shlex::split(line).ok_or_else(|| format!("quotes do not close: {line}"))?;
    let mut commands = vec![Vec::new()];
    let mut words = words.into_iter();
    while let Some(word) = words.next() {
        if SEPARATORS.contains(&word.as_str()) {
            commands.push(Vec::new());
        } else if word == ">" || word == "<" || word == "2>" {
            words.next();
        } else if let Some(last) = commands.last_mut() {
            last.push(word.trim_matches(['[', ']']).to_owned());
        }
    }
    commands.retain(|command| !command.is_empty());
    Ok(commands)
}

/// The arguments of a command that runs `dsm`, however it is called: by name, as built, or through cargo.
pub fn find_dsm(command: &[String]) -> Option<&[String]> {
    let begin = command.iter().position(|word| !word.contains('=') || word.starts_with('-'))?;
    let command = &command[begin..];
    match command.first()?.as_str() {
        "dsm" | "target/release/dsm" => Some(&command[1..]),
        "cargo" if command.get(1).is_some_and(|word| word == "run") => {
            // Another package or an example is another program.
            let other = |word: &String| ["-p", "--package", "--example", "--bin"].contains(&word.as_str());
            let end = command.iter().position(|word| word == "--")?;
            (!command[..end].iter().any(other)).then(|| &command[end + 1..])
        }
        _ => None,
    }
}

/// Parses the arguments as the program does.
pub fn parse(arguments: &[String]) -> Result<(), String> {
    let words = std::iter::once("dsm").chain(arguments.iter().map(String::as_str));
    match Cli::command().try_get_matches_from(words) {
        Ok(_) => Ok(()),
        Err(error) if error.exit_code() == 0 => Ok(()),
        Err(error) => Err(error.to_string().lines().next().unwrap_or_default().to_owned()),
    }
}

/// A mention such as `dsm suite --seeds A..B` names a command and flags that there are; its values are examples.
pub fn check_mention(arguments: &[String]) -> Result<(), String> {
    let mut root = Cli::command();
    root.build();
    let mut command: &Command = &root;
    for word in arguments {
        if let Some(flag) = word.strip_prefix("--") {
            let flag = flag.split('=').next().unwrap_or(flag);
            let is_known = flag == "help" || command.get_arguments().any(|arg| arg.get_long() == Some(flag));
            if !is_known {
                return Err(format!("`{}` has no flag --{flag}", command.get_name()));
            }
        } else if let Some(found) = command.find_subcommand(word) {
            command = found;
        } else if command.has_subcommands() && word.chars().all(|c| c.is_ascii_lowercase() || c == '-') {
            return Err(format!("`{}` has no command `{word}`", command.get_name()));
        }
    }
    Ok(())
}
