//! The schema: what an option is called, what it may be, and where it is kept.
//!
//! A [`Knob`] connects a field of a message with a setting, and has all that the command line, the service and the page need to know
//! of the option. The tables are in `tables`.

use super::Violations;
pub use super::kind::{Choice, Kind, Value};
use super::slot::Slot;

/// A message with options, and the settings that they become.
pub trait Options: Default + Clone + 'static {
    /// The settings.
    type Settings: Default + 'static;

    /// The settings where no option is applied.
    fn start(&self) -> Self::Settings {
        Self::Settings::default()
    }

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
    /// What its value is called in the help; empty for the usual name of its kind.
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

/// Sets fields of an option.
macro_rules! with {
    ($($name:ident: $type:ty),*) => {$(
        pub(super) const fn $name(self, $name: $type) -> Self {
            Self { $name, ..self }
        }
    )*};
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

    with!(help: &'static str, details: &'static str, value_name: &'static str, unit: &'static str);

    with!(label: &'static str, default: &'static str);

    with!(aliases: &'static [&'static str], excludes: &'static [&'static str]);

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
    M::KNOBS.iter().fold(message.start(), |settings, knob| knob.apply(&mut message, settings, wrong))
}
