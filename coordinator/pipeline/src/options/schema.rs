//! The types of the schema: what an option is called, what it may be, and where it is kept.
//!
//! A [`Knob`] connects one field of a message with one of the settings, and says everything that the command line, the service and
//! the page need to know of it. The tables are in `tables`.

use std::ops::RangeInclusive;

use glam::DVec3;
use protocol::api;

use bake::{BakeSettings, LightPart, RowStrategy};
use output::export::Domain;
use scene::LightUnit;

use super::Violations;

/// All positive numbers.
pub(super) const POSITIVE: RangeInclusive<f64> = 5e-324..=f64::MAX;

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
                format!("must have at most {} characters, all of them printable", super::LONGEST_TEXT)
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
            (Self::Text, Value::Text(text)) => super::is_short(text),
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

/// A place for a value: a field of a message or of settings.
pub trait Slot {
    /// The value, if there is one.
    fn get(&self) -> Option<Value>;

    /// Sets the value. One of another kind changes nothing.
    fn set(&mut self, value: Value);
}

/// A message with options, and the settings that they become.
pub trait Options: Default + Clone + 'static {
    /// The settings.
    type Settings: Default + 'static;

    /// Heading on the command line.
    const HEADING: &'static str;

    /// The options, in the order in which they are shown and applied.
    const KNOBS: &'static [Knob<Self>];
}

/// Reads the value of a field.
type Field<M> = fn(&mut M) -> &mut dyn Slot;

/// Settings with the value of an option.
type Change<S> = fn(S, f64) -> S;

/// One option.
pub struct Knob<M: Options> {
    /// Field of the API, such as `bake.error`: errors of the service name it.
    pub path: &'static str,
    /// Name on the command line, without its dashes.
    pub flag: &'static str,
    /// Former names on the command line.
    pub aliases: &'static [&'static str],
    /// The values that it may have.
    pub kind: Kind,
    /// What its value is called in the help; empty for the name of the option.
    pub value_name: &'static str,
    /// One line of help.
    pub help: &'static str,
    /// More help, for who asks for it.
    pub details: &'static str,
    /// Unit; empty where there is none.
    pub unit: &'static str,
    /// Name in the form of the page; empty where it is not there.
    pub label: &'static str,
    /// What holds where the option is not given, in words; `{}` stands for the default of the settings. Empty: that default.
    pub default: &'static str,
    /// Options that this one cannot be combined with: it chooses them.
    pub excludes: &'static [&'static str],
    /// Whether it is for experts.
    pub advanced: bool,
    /// Field of the message.
    field: Field<M>,
    /// The setting.
    setting: Field<M::Settings>,
    /// How the settings change, where it takes more than one of them.
    change: Option<Change<M::Settings>>,
}

impl<M: Options> Knob<M> {
    pub(super) const fn new(
        path: &'static str,
        flag: &'static str,
        kind: Kind,
        field: Field<M>,
        setting: Field<M::Settings>,
    ) -> Self {
        Self {
            path,
            flag,
            aliases: &[],
            kind,
            value_name: "",
            help: "",
            details: "",
            unit: "",
            label: "",
            default: "",
            excludes: &[],
            advanced: false,
            field,
            setting,
            change: None,
        }
    }

    pub(super) const fn help(self, help: &'static str) -> Self {
        Self { help, ..self }
    }

    pub(super) const fn details(self, details: &'static str) -> Self {
        Self { details, ..self }
    }

    pub(super) const fn value_name(self, value_name: &'static str) -> Self {
        Self { value_name, ..self }
    }

    pub(super) const fn unit(self, unit: &'static str) -> Self {
        Self { unit, ..self }
    }

    pub(super) const fn label(self, label: &'static str) -> Self {
        Self { label, ..self }
    }

    pub(super) const fn default(self, default: &'static str) -> Self {
        Self { default, ..self }
    }

    pub(super) const fn aliases(self, aliases: &'static [&'static str]) -> Self {
        Self { aliases, ..self }
    }

    pub(super) const fn excludes(self, excludes: &'static [&'static str]) -> Self {
        Self { excludes, ..self }
    }

    pub(super) const fn advanced(self) -> Self {
        Self { advanced: true, ..self }
    }

    pub(super) const fn change(self, change: Change<M::Settings>) -> Self {
        Self { change: Some(change), ..self }
    }

    /// The value that a message has.
    pub fn get(&self, message: &mut M) -> Option<Value> {
        (self.field)(message).get()
    }

    /// Sets the value in a message.
    pub fn set(&self, message: &mut M, value: Value) {
        (self.field)(message).set(value);
    }

    /// The default of the settings.
    #[must_use]
    pub fn default_value(&self) -> Option<Value> {
        (self.setting)(&mut M::Settings::default()).get()
    }

    /// The default in words; empty where there is none to tell.
    #[must_use]
    pub fn default_text(&self) -> String {
        let value = self.default_value().map(|value| self.kind.show(&value)).unwrap_or_default();
        if self.default.is_empty() { value } else { self.default.replace("{}", &value) }
    }

    /// The settings with the value that a message has; notes what is wrong with it.
    fn apply(&self, message: &mut M, settings: M::Settings, wrong: &mut Violations) -> M::Settings {
        let Some(value) = self.get(message) else { return settings };
        let allowed = self.kind.allows(&value);
        wrong.demand(allowed, self.path, self.kind.should());
        let others = M::KNOBS.iter().filter(|other| self.excludes.contains(&other.flag));
        let excluded: Vec<_> =
            others.filter(|other| other.get(message).is_some()).map(|other| other.path).collect();
        wrong.demand(
            excluded.is_empty(),
            self.path,
            format!("cannot be combined with {}, which it chooses", excluded.join(" and ")),
        );
        let mut settings = settings;
        match (self.change, &value) {
            _ if !allowed => {}
            (Some(change), Value::Number(number)) => settings = change(settings, *number),
            (Some(change), Value::Whole(number)) => settings = change(settings, *number as f64),
            _ => (self.setting)(&mut settings).set(value),
        }
        settings
    }
}

/// The settings that a message asks for; notes what is wrong with it.
pub(super) fn settings<M: Options>(message: &M, wrong: &mut Violations) -> M::Settings {
    let mut message = message.clone();
    M::KNOBS.iter().fold(M::Settings::default(), |settings, knob| knob.apply(&mut message, settings, wrong))
}

/// Fields that are whole numbers.
macro_rules! whole {
    ($($type:ty),*) => {$(
        impl Slot for $type {
            fn get(&self) -> Option<Value> {
                Some(Value::Whole(*self as i128))
            }

            fn set(&mut self, value: Value) {
                if let Value::Whole(number) = value {
                    *self = <$type>::try_from(number).unwrap_or(<$type>::MAX);
                }
            }
        }
    )*};
}

whole!(u32, u64, usize);

impl<T: Slot + Default> Slot for Option<T> {
    fn get(&self) -> Option<Value> {
        self.as_ref().and_then(T::get)
    }

    fn set(&mut self, value: Value) {
        self.get_or_insert_default().set(value);
    }
}

/// The number of a choice, or a priority: 0 stands for nothing said.
impl Slot for i32 {
    fn get(&self) -> Option<Value> {
        (*self != 0).then(|| Value::Whole((*self).into()))
    }

    fn set(&mut self, value: Value) {
        if let Value::Whole(number) = value {
            *self = Self::try_from(number).unwrap_or(Self::MAX);
        }
    }
}

impl Slot for f64 {
    fn get(&self) -> Option<Value> {
        Some(Value::Number(*self))
    }

    fn set(&mut self, value: Value) {
        if let Value::Number(number) = value {
            *self = number;
        }
    }
}

impl Slot for bool {
    fn get(&self) -> Option<Value> {
        Some(Value::Flag(*self))
    }

    fn set(&mut self, value: Value) {
        if let Value::Flag(flag) = value {
            *self = flag;
        }
    }
}

impl Slot for String {
    fn get(&self) -> Option<Value> {
        (!self.is_empty()).then(|| Value::Text(self.clone()))
    }

    fn set(&mut self, value: Value) {
        if let Value::Text(text) = value {
            *self = text;
        }
    }
}

impl Slot for DVec3 {
    fn get(&self) -> Option<Value> {
        Some(Value::Colour(*self))
    }

    fn set(&mut self, value: Value) {
        if let Value::Colour(colour) = value {
            *self = colour;
        }
    }
}

impl Slot for api::Colour {
    fn get(&self) -> Option<Value> {
        Some(Value::Colour(DVec3::new(self.r, self.g, self.b)))
    }

    fn set(&mut self, value: Value) {
        if let Value::Colour(DVec3 { x: r, y: g, z: b }) = value {
            *self = Self { r, g, b };
        }
    }
}

/// Settings with names, each the number of a message.
macro_rules! choices {
    ($($type:ty, $message:ty: $($variant:ident = $number:ident),*;)*) => {$(
        impl Slot for $type {
            fn get(&self) -> Option<Value> {
                let number = match self { $(Self::$variant => <$message>::$number,)* };
                Some(Value::Whole((number as i32).into()))
            }

            fn set(&mut self, value: Value) {
                $(if value == Value::Whole((<$message>::$number as i32).into()) {
                    *self = Self::$variant;
                })*
            }
        }
    )*};
}

choices! {
    RowStrategy, api::RowsOf: Automatic = Unspecified, Exact = Shooters, Gather = Receivers;
    LightUnit, api::LightUnit: Candela = Candela, Watt = Watt;
    LightPart, api::Part: All = All, Direct = Direct, Indirect = Indirect;
    Domain, api::Domain: Vertex = Vertex, Corner = Corner;
}

/// The settings of a bake that a target error asks for.
pub(super) fn for_error(_: BakeSettings, error: f64) -> BakeSettings {
    BakeSettings::for_error(error)
}
