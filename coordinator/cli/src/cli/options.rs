//! Options of the command line that the service offers too: built from the schema of `pipeline::options`.

use std::marker::PhantomData;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Arg, ArgAction, ArgMatches, Args, Command, Error, FromArgMatches};
use pipeline::options::schema::{Kind, Knob, Options, Value};

/// Options of a message that a command does not use, by their flags.
pub trait Unused {
    /// Their flags.
    const FLAGS: &'static [&'static str];
}

/// A command uses all options.
impl Unused for () {
    const FLAGS: &'static [&'static str] = &[];
}

/// The options of a message, as they are given.
pub struct Given<M, U = ()>(pub M, PhantomData<U>);

/// The options that a command uses.
fn knobs<M: Options, U: Unused>() -> impl Iterator<Item = &'static Knob<M>> {
    M::KNOBS.iter().filter(|knob| !U::FLAGS.contains(&knob.flag))
}

impl<M: Options, U: Unused> Args for Given<M, U> {
    fn augment_args(command: Command) -> Command {
        command.args(knobs::<M, U>().map(argument))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<M: Options, U: Unused> FromArgMatches for Given<M, U> {
    /// Options that are not given have the default of the settings, if there is one value and no other option chooses it.
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        let given = |knob: &Knob<M>| {
            matches.get_one::<Value>(knob.path).filter(|value| **value != Value::Flag(false))
        };
        let chosen: Vec<_> =
            knobs::<M, U>().filter(|knob| given(knob).is_some()).flat_map(|knob| knob.excludes).collect();
        let mut message = M::default();
        for knob in knobs::<M, U>() {
            let default =
                || knob.default_value().filter(|_| knob.default.is_empty() && !chosen.contains(&&knob.flag));
            if let Some(value) = given(knob).cloned().or_else(default) {
                knob.set(&mut message, value);
            }
        }
        Ok(Self(message, PhantomData))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

fn argument<M: Options>(knob: &'static Knob<M>) -> Arg {
    let unit = if knob.unit.is_empty() { String::new() } else { format!(", in {}", knob.unit) };
    let default = match &knob.kind {
        Kind::Flag => String::new(),
        _ => format!(" [default: {}]", knob.default_text()),
    };
    let help = format!("{}{unit}{default}", knob.help);
    let excluded = M::KNOBS.iter().filter(|other| knob.excludes.contains(&other.flag));
    let argument = Arg::new(knob.path)
        .long(knob.flag)
        .aliases(knob.aliases)
        .conflicts_with_all(excluded.map(|other| other.path))
        .help_heading(if knob.advanced { "Advanced quality" } else { M::HEADING });
    let argument = match knob.details {
        "" => argument,
        details => argument.long_help(format!("{help}\n\n{details}")),
    };
    let argument = argument.help(help);
    let argument = argument.value_name(match (&knob.kind, knob.value_name) {
        (Kind::Number(_) | Kind::Fraction(_), "") => "NUMBER",
        (Kind::Whole(_), "") => "N",
        (_, "") => "NAME",
        (_, name) => name,
    });
    match &knob.kind {
        Kind::Flag => argument.action(ArgAction::SetTrue).value_parser(|text: &str| knob.kind.parse(text)),
        Kind::Choice(choices) => {
            let names = choices
                .iter()
                .map(|choice| PossibleValue::new(choice.name).help(choice.help).aliases(choice.aliases));
            let names = PossibleValuesParser::new(names);
            argument.value_parser(names.try_map(|name| knob.kind.parse(&name)))
        }
        Kind::Whole(range) if *range.start() < 0 => {
            argument.allow_negative_numbers(true).value_parser(|text: &str| knob.kind.parse(text))
        }
        _ => argument.value_parser(|text: &str| knob.kind.parse(text)),
    }
}

/// A positive number.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("must be a positive number".into()),
    }
}
