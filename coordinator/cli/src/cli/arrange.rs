//! Reads the command line: options before the command are moved behind it, and options that a command does not use are refused
//! by name.

use std::ffi::{OsStr, OsString};

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, Command, CommandFactory, Error, FromArgMatches};

use super::Arguments;

/// Reads the arguments of the process.
///
/// # Errors
/// Help, the version, or what is wrong.
pub fn parse(words: impl IntoIterator<Item = OsString>) -> Result<Arguments, Error> {
    let mut command = Arguments::command().mut_subcommands(|command| command.mut_args(move_variable));
    let words = arranged(words.into_iter().collect(), &command);
    let matches =
        command.try_get_matches_from_mut(&words).map_err(|error| explained(error, &words, &mut command))?;
    Arguments::from_arg_matches(&matches)
}

/// Moves the variable of the environment from the line of an option to its longer help.
fn move_variable(argument: Arg) -> Arg {
    let Some(variable) = argument.get_env().map(OsStr::to_os_string) else { return argument };
    let help = argument.get_long_help().or(argument.get_help()).map(ToString::to_string).unwrap_or_default();
    argument.hide_env(true).long_help(format!("{help}\n\n[env: {}]", variable.display()))
}

/// The option of this name in any command, as it is in the first that has it.
fn option<'a>(command: &'a Command, name: &str) -> Option<&'a Arg> {
    command.get_arguments().find(|argument| {
        let long = argument.get_long_and_visible_aliases().unwrap_or_default();
        let hidden = argument.get_all_aliases().unwrap_or_default();
        let short = argument.get_short().map(|short| format!("-{short}"));
        name.strip_prefix("--").is_some_and(|name| long.contains(&name) || hidden.contains(&name))
            || short.is_some_and(|short| short == name)
    })
}

/// The words with the command first. Options without a command are those of `serve`.
fn arranged(words: Vec<OsString>, command: &Command) -> Vec<OsString> {
    let mut at = 1;
    while let Some(word) = words.get(at).and_then(|word| word.to_str()).filter(|word| word.starts_with('-')) {
        let (name, has_value) = word.split_once('=').map_or((word, false), |(name, _)| (name, true));
        let Some(option) = command.get_subcommands().find_map(|command| option(command, name)) else { break };
        at += if option.get_action().takes_values() && !has_value { 2 } else { 1 };
    }
    let is_command = |word: &OsString| command.get_subcommands().any(|command| **word == *command.get_name());
    let (chosen, after) = match words.get(at) {
        _ if at == 1 => return words,
        Some(word) if is_command(word) => (word.clone(), at + 1),
        Some(_) => return words,
        None => ("serve".into(), at),
    };
    let before = words[1..at.min(words.len())].iter().cloned();
    let after = words[after.min(words.len())..].iter().cloned();
    [words[0].clone(), chosen].into_iter().chain(before).chain(after).collect()
}

/// An error that says which commands have an option, where the command does not.
fn explained(error: Error, words: &[OsString], command: &mut Command) -> Error {
    let Some(ContextValue::String(given)) = error.get(ContextKind::InvalidArg) else { return error };
    let name = given.split('=').next().unwrap_or(given);
    let users: Vec<_> = command
        .get_subcommands()
        .filter(|command| option(command, name).is_some())
        .map(|command| format!("`{}`", command.get_name()))
        .collect();
    if error.kind() != ErrorKind::UnknownArgument || users.is_empty() {
        return error;
    }
    let chosen = words.get(1).map(|word| word.to_string_lossy()).unwrap_or_default();
    let message = format!("`{chosen}` does not use {name}: leave it out; it belongs to {}", users.join(", "));
    command.error(ErrorKind::UnknownArgument, message)
}

#[cfg(test)]
mod tests {
    use super::super::Command as Chosen;
    use super::*;

    fn parse(line: &str) -> Result<Arguments, Error> {
        super::parse(line.split_whitespace().map(OsString::from))
    }

    #[test]
    fn the_declarations_agree() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn without_arguments_there_is_help() {
        let told = parse("coordinator").err().unwrap();
        assert_eq!(told.kind(), ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand);
        assert!(told.to_string().contains("solve"), "{told}");
    }

    #[test]
    fn options_of_the_service_go_with_serve_or_no_command() {
        for line in [
            "coordinator --jobs 3",
            "coordinator --jobs 3 --workers first:7070",
            "coordinator --listen-plaintext --jobs=3",
            "coordinator serve",
            "coordinator serve --jobs 3",
            "coordinator --workers first:7070 serve --jobs 3",
            "coordinator --jobs 3 serve",
        ] {
            assert!(matches!(parse(line), Ok(Arguments { command: Chosen::Serve(_) })), "{line}");
        }
    }

    #[test]
    fn options_that_a_command_does_not_use_are_refused_by_name() {
        for (line, option, command, owner) in [
            ("coordinator --jobs 3 solve scene.glb -o lit.glb", "--jobs", "solve", "serve"),
            ("coordinator --data=here jobs", "--data", "jobs", "serve"),
            ("coordinator --listen-plaintext watch 1", "--listen-plaintext", "watch", "serve"),
            ("coordinator relight a.glb --kept k -o b.glb --threads 2", "--threads", "relight", "solve"),
            ("coordinator --workers a:1 jobs", "--workers", "jobs", "render"),
            ("coordinator submit a.glb --row-cache 3", "--row-cache", "submit", "solve"),
            ("coordinator reference a.glb -o b.csv --weld 1", "--weld", "reference", "form-factors"),
            ("coordinator form-factors a.glb -o b.csv --sky 1,1,1", "--sky", "form-factors", "reference"),
            (
                "coordinator form-factors a.glb -o b.csv --light-unit watt",
                "--light-unit",
                "form-factors",
                "solve",
            ),
        ] {
            let told = parse(line).err().unwrap().to_string();
            for word in [option, command, owner] {
                assert!(told.contains(word), "{line}: {told}");
            }
        }
    }

    #[test]
    fn options_for_a_command_go_before_it_too() {
        for line in [
            "coordinator --workers first:7070 solve scene.glb -o lit.glb",
            "coordinator --check-points=3 --planar-point-lights -o lit.glb solve scene.glb --rows suiting",
        ] {
            assert!(matches!(parse(line), Ok(Arguments { command: Chosen::Solve(_) })), "{line}");
        }
        assert_eq!(parse("coordinator --nonsense solve").err().unwrap().kind(), ErrorKind::UnknownArgument);
    }

    #[test]
    fn an_option_takes_one_line_of_help() {
        let mut command = Arguments::command();
        for command in command.get_subcommands_mut() {
            for argument in command.get_arguments() {
                let help = argument.get_help().map(ToString::to_string).unwrap_or_default();
                assert!(!help.is_empty() && !help.contains('\n'), "{}: {help}", argument.get_id());
                assert!(help.chars().count() <= 120, "{}: {help}", argument.get_id());
            }
        }
    }
}
