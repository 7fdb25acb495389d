//! The values that an option may have: how they are read, checked and shown.

use std::ops::RangeInclusive;

use glam::DVec3;

/// All positive numbers.
pub(super) const POSITIVE: RangeInclusive<f64> = 5e-324..=f64::MAX;

/// Longest text of a client: names, units, keys.
const LONGEST_TEXT: usize = 200;

/// The value of an option.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A real number.
    Number(f64),
    /// A whole number, or that of a choice.
    Whole(i128),
    /// Yes or no.
    Flag(bool),
    /// A text.
    Text(String),
    /// Linear RGB.
    Colour(DVec3),
}

/// Whether a text of a client is short enough, and printable.
#[must_use]
pub fn is_short(text: &str) -> bool {
    text.chars().count() <= LONGEST_TEXT && !text.contains(char::is_control)
}

/// One of several values with names.
#[derive(Debug)]
pub struct Choice {
    /// Name on the command line.
    pub name: &'static str,
    /// Former names.
    pub aliases: &'static [&'static str],
    /// What it stands for.
    pub help: &'static str,
    /// Number in the message.
    pub number: i32,
}

/// The values that an option may have.
#[derive(Debug)]
pub enum Kind {
    /// A real number in a range.
    Number(RangeInclusive<f64>),
    /// A part of a whole, which people read in percent.
    Fraction(RangeInclusive<f64>),
    /// A whole number in a range.
    Whole(RangeInclusive<i128>),
    /// One of these.
    Choice(&'static [Choice]),
    /// Yes or no.
    Flag,
    /// A short text.
    Text,
    /// Linear RGB: three numbers that are not negative.
    Colour,
}

impl Kind {
    /// What a value must be, as the end of a sentence.
    #[must_use]
    pub fn should(&self) -> String {
        match self {
            Self::Number(range) if *range == POSITIVE => "must be a positive number".into(),
            Self::Number(range) => format!("must be a number from {} to {}", range.start(), range.end()),
            Self::Fraction(range) => {
                format!("must be a number from {} to {}: 0.02 is 2 %", range.start(), range.end())
            }
            Self::Whole(range) if *range.end() >= i128::from(u32::MAX) => {
                format!("must be a whole number from {}", range.start())
            }
            Self::Whole(range) => format!("must be a whole number from {} to {}", range.start(), range.end()),
            Self::Choice(choices) => {
                let names: Vec<_> = choices.iter().map(|choice| choice.name).collect();
                format!("must be one of {}", names.join(", "))
            }
            Self::Flag => "must be true or false".into(),
            Self::Text => {
                format!("must have at most {LONGEST_TEXT} characters, all of them printable")
            }
            Self::Colour => "must be three numbers that are not negative, such as 0.8,0.9,1.2".into(),
        }
    }

    /// Whether this value is allowed.
    #[must_use]
    pub fn allows(&self, value: &Value) -> bool {
        match (self, value) {
            (Self::Number(range) | Self::Fraction(range), Value::Number(value)) => range.contains(value),
            (Self::Whole(range), Value::Whole(value)) => range.contains(value),
            (Self::Choice(choices), Value::Whole(value)) => {
                choices.iter().any(|choice| i128::from(choice.number) == *value)
            }
            (Self::Text, Value::Text(text)) => is_short(text),
            (Self::Colour, Value::Colour(colour)) => colour.is_finite() && colour.min_element() >= 0.0,
            (Self::Flag, Value::Flag(_)) => true,
            _ => false,
        }
    }

    /// Reads a value.
    ///
    /// # Errors
    /// What it must be, if it is anything else.
    pub fn parse(&self, text: &str) -> Result<Value, String> {
        let value = match self {
            Self::Number(_) | Self::Fraction(_) => text.parse().ok().map(Value::Number),
            Self::Whole(_) => text.parse().ok().map(Value::Whole),
            Self::Flag => text.parse().ok().map(Value::Flag),
            Self::Text => Some(Value::Text(text.to_owned())),
            Self::Colour => {
                let parts: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
                let parts = parts.and_then(|parts| <[f64; 3]>::try_from(parts).ok());
                parts.map(|parts| Value::Colour(parts.into()))
            }
            Self::Choice(choices) => choices
                .iter()
                .find(|choice| choice.name == text || choice.aliases.contains(&text))
                .map(|choice| Value::Whole(choice.number.into())),
        };
        value.filter(|value| self.allows(value)).ok_or_else(|| self.should())
    }

    /// A value as the command line takes it.
    #[must_use]
    pub fn show(&self, value: &Value) -> String {
        match value {
            Value::Number(number) if *number != 0.0 && number.abs() < 1e-3 => format!("{number:e}"),
            Value::Number(number) => number.to_string(),
            Value::Whole(number) => match self {
                Self::Choice(choices) => choices
                    .iter()
                    .find(|choice| i128::from(choice.number) == *number)
                    .map_or_else(|| number.to_string(), |choice| choice.name.to_owned()),
                _ => number.to_string(),
            },
            Value::Flag(flag) => flag.to_string(),
            Value::Text(text) => text.clone(),
            Value::Colour(colour) => format!("{},{},{}", colour.x, colour.y, colour.z),
        }
    }
}
