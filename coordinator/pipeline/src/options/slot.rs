//! The places where values are kept: fields of messages, and settings.

use glam::DVec3;
use protocol::api;

use bake::{LightPart, Quality, RowStrategy};
use output::export::{Compression, Domain, Materials, PageFormat};
use scene::LightUnit;

use super::kind::Value;

/// A place for a value: a field of a message or of settings.
pub trait Slot {
    /// The value, if there is one.
    fn get(&self) -> Option<Value>;

    /// Sets the value. One of another kind changes nothing.
    fn set(&mut self, value: Value);
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

/// Fields that are values as they are.
macro_rules! plain {
    ($($type:ty: $kind:ident),*) => {$(
        impl Slot for $type {
            fn get(&self) -> Option<Value> {
                Some(Value::$kind(*self))
            }

            fn set(&mut self, value: Value) {
                if let Value::$kind(value) = value {
                    *self = value;
                }
            }
        }
    )*};
}

plain!(f64: Number, bool: Flag, DVec3: Colour);

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
    Quality, api::Quality: Draft = Draft, Preview = Preview, Final = Final;
    LightUnit, api::LightUnit: Candela = Candela, Watt = Watt, Blender = Blender, BlenderUnitless = BlenderUnitless;
    LightPart, api::Part: All = All, Direct = Direct, Indirect = Indirect;
    Domain, api::Domain: Vertex = Vertex, Corner = Corner;
    Materials, api::Materials: Unlit = Unlit, Keep = Keep;
    Compression, api::Compression: AsInput = Unspecified, None = None, Meshopt = Meshopt;
    PageFormat, api::LightmapFormat: Png = Png, Rgbm = Rgbm, Exr = Exr, Ktx2 = Ktx2;
}
