//! [`Signals`]: a named vector with units, of a length known to the compiler.
//!
//! One declaration gives states, inputs, outputs and parameters their names; values, bounds, guesses, slopes, standard
//! errors, CSV columns and report rows of one vector are then the same struct with another content.

use core::fmt::Debug;

/// Types of the entries of a signal vector: numbers, guesses, intervals, names.
pub trait Entry: Copy + Debug + Send + Sync + 'static {}
impl<T: Copy + Debug + Send + Sync + 'static> Entry for T {}

/// The vector of signals `S` with entries of type `T`: `Of<Currents, Dual<8>>` is `Currents<Dual<8>>`.
pub type Of<S, T> = <S as Signals>::Of<T>;

/// A named vector. Implemented by [`signals!`](crate::signals!), for the struct with `f64` entries.
pub trait Signals: Copy + Debug + Default + PartialEq + Send + Sync + 'static {
    /// This vector with entries of type `T`.
    type Of<T: Entry>: Entry;
    /// `[T; LEN]`.
    type Array<T: Entry>: Entry + AsRef<[T]> + AsMut<[T]> + IntoIterator<Item = T>;

    /// How many signals.
    const LEN: usize;
    /// Their names, in order of declaration.
    const NAMES: &'static [&'static str];
    /// Their units, in the same order; `""` or `"1"` for a ratio.
    const UNITS: &'static [&'static str];

    /// The entries in order.
    fn into_array<T: Entry>(signals: Self::Of<T>) -> Self::Array<T>;
    /// The vector with these entries.
    fn from_array<T: Entry>(entries: Self::Array<T>) -> Self::Of<T>;
    /// `[f(0), f(1), ...]`.
    fn array_from_fn<T: Entry>(f: impl FnMut(usize) -> T) -> Self::Array<T>;

    /// The vector whose entry `i` is `f(i)`.
    #[inline(always)]
    fn from_fn<T: Entry>(f: impl FnMut(usize) -> T) -> Self::Of<T> {
        Self::from_array(Self::array_from_fn(f))
    }
    /// Each entry through `f`.
    #[inline(always)]
    fn map<T: Entry, V: Entry>(signals: Self::Of<T>, mut f: impl FnMut(T) -> V) -> Self::Of<V> {
        let entries = Self::into_array(signals);
        Self::from_fn(|i| f(entries.as_ref()[i]))
    }
    /// Every entry the same.
    #[inline(always)]
    fn splat<T: Entry>(entry: T) -> Self::Of<T> {
        Self::from_fn(|_| entry)
    }
    /// The position of a name.
    fn position(name: &str) -> Option<usize> {
        Self::NAMES.iter().position(|known| *known == name)
    }
    /// The signals of `P` by their names out of these, which may hold others besides: how the parameters of a composed model
    /// become those of its parts. A name that is missing, or that has another unit, does not compile.
    ///
    /// ```
    /// use greybox::{Signals, signals};
    /// signals! {
    ///     pub struct Coil { r: "ohm", l: "H" }
    ///     pub struct Motor { l: "H", r: "ohm", ke: "V s/rad" }
    /// }
    /// let motor = Motor { l: 2e-3, r: 0.4, ke: 0.95 };
    /// assert_eq!(Motor::<f64>::part::<Coil, f64>(motor), Coil { r: 0.4, l: 2e-3 });
    /// ```
    #[inline(always)]
    fn part<P: Signals, T: Entry>(signals: Self::Of<T>) -> P::Of<T> {
        let entries = Self::into_array(signals);
        P::from_fn(|i| entries.as_ref()[Places::<Self, P>::AT[i]])
    }
}

/// Where the signals of `P` stand among those of `W`.
struct Places<W, P>(core::marker::PhantomData<(W, P)>);

/// Most signals of a part.
const MOST: usize = 64;

impl<W: Signals, P: Signals> Places<W, P> {
    const AT: [usize; MOST] = {
        assert!(P::LEN <= MOST, "a part has at most 64 signals");
        let (mut at, mut i) = ([0; MOST], 0);
        while i < P::LEN {
            at[i] = place_of(W::NAMES, P::NAMES[i]);
            assert!(same(W::UNITS[at[i]], P::UNITS[i]), "a signal has another unit in the part than in the whole");
            i += 1;
        }
        at
    };
}

/// The position of a name that must be there.
pub(crate) const fn place_of(names: &[&str], name: &str) -> usize {
    let place = search(names, name);
    assert!(place < names.len(), "a signal of the part is missing in the whole: the two names must be the same");
    place
}

/// Whether a name is there.
pub(crate) const fn holds(names: &[&str], name: &str) -> bool {
    search(names, name) < names.len()
}

/// The position of a name; the number of names, if it is not there.
const fn search(names: &[&str], name: &str) -> usize {
    let mut i = 0;
    while i < names.len() && !same(names[i], name) {
        i += 1;
    }
    i
}

const fn same(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    if a.len() != b.len() {
        return false;
    }
    let mut i = 0;
    while i < a.len() {
        if a[i] != b[i] {
            return false;
        }
        i += 1;
    }
    true
}

/// Declares a named vector: a struct generic over its entries (`f64` unless said otherwise), each field with its unit.
///
/// The struct is `Copy`, compares, converts to and from arrays and nalgebra's `SVector`, implements serde (a map by
/// name) and approx (`assert_relative_eq!`). Documentation and attributes may stand on the struct and on its fields.
///
/// ```
/// use greybox::{Signals, signals};
/// signals! {
///     /// Stator currents in the rotor frame, phase peak.
///     pub struct Currents { id: "A", iq: "A" }
/// }
/// let i = Currents { id: 0.5, iq: -2.0 };
/// assert_eq!(Currents::<f64>::NAMES, ["id", "iq"]);
/// assert_eq!(<[f64; 2]>::from(i), [0.5, -2.0]);
/// ```
#[macro_export]
macro_rules! signals {
    ($($(#[$meta:meta])* $vis:vis struct $name:ident { $($(#[$field_meta:meta])* $field:ident : $unit:literal),* $(,)? })+) => {$(
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        $vis struct $name<T = f64> {
            $($(#[$field_meta])* #[doc = concat!("\n\nUnit: ", $unit)] pub $field: T,)*
        }

        impl $crate::Signals for $name<f64> {
            type Of<T: $crate::Entry> = $name<T>;
            type Array<T: $crate::Entry> = [T; $crate::__count!($($field)*)];
            const LEN: usize = $crate::__count!($($field)*);
            const NAMES: &'static [&'static str] = &[$(stringify!($field)),*];
            const UNITS: &'static [&'static str] = &[$($unit),*];

            #[inline(always)]
            fn into_array<T: $crate::Entry>(signals: $name<T>) -> Self::Array<T> {
                [$(signals.$field),*]
            }
            #[inline(always)]
            fn from_array<T: $crate::Entry>(entries: Self::Array<T>) -> $name<T> {
                let [$($field),*] = entries;
                $name { $($field),* }
            }
            // Not by `core::array::from_fn`, which was a twelfth of the intermediate code of a fit.
            #[inline(always)]
            #[allow(unused_assignments)]
            fn array_from_fn<T: $crate::Entry>(mut f: impl FnMut(usize) -> T) -> Self::Array<T> {
                let mut next = 0;
                [$({
                    let $field = f(next);
                    next += 1;
                    $field
                }),*]
            }
        }

        impl<T> From<[T; $crate::__count!($($field)*)]> for $name<T> {
            #[inline(always)]
            fn from([$($field),*]: [T; $crate::__count!($($field)*)]) -> Self {
                $name { $($field),* }
            }
        }
        impl<T> ::core::convert::From<$name<T>> for [T; $crate::__count!($($field)*)] {
            #[inline(always)]
            fn from(signals: $name<T>) -> Self {
                [$(signals.$field),*]
            }
        }
        impl<T> ::core::convert::From<$crate::nalgebra::SVector<T, { $crate::__count!($($field)*) }>> for $name<T> {
            #[inline(always)]
            fn from(vector: $crate::nalgebra::SVector<T, { $crate::__count!($($field)*) }>) -> Self {
                let [[$($field),*]] = vector.data.0;
                $name { $($field),* }
            }
        }
        impl<T> ::core::convert::From<$name<T>> for $crate::nalgebra::SVector<T, { $crate::__count!($($field)*) }> {
            #[inline(always)]
            fn from(signals: $name<T>) -> Self {
                $crate::nalgebra::Matrix::from_data($crate::nalgebra::ArrayStorage([[$(signals.$field),*]]))
            }
        }

        impl<T: $crate::approx::AbsDiffEq<Epsilon: Copy>> $crate::approx::AbsDiffEq for $name<T> {
            type Epsilon = T::Epsilon;
            fn default_epsilon() -> T::Epsilon {
                T::default_epsilon()
            }
            fn abs_diff_eq(&self, other: &Self, epsilon: T::Epsilon) -> bool {
                $(self.$field.abs_diff_eq(&other.$field, epsilon))&&*
            }
        }
        impl<T: $crate::approx::RelativeEq<Epsilon: Copy>> $crate::approx::RelativeEq for $name<T> {
            fn default_max_relative() -> T::Epsilon {
                T::default_max_relative()
            }
            fn relative_eq(&self, other: &Self, epsilon: T::Epsilon, max_relative: T::Epsilon) -> bool {
                $(self.$field.relative_eq(&other.$field, epsilon, max_relative))&&*
            }
        }

        // The field names become the keys; a missing or unknown one is an error that names it.
        const _: () = {
            use $crate::serde;
            impl<T: serde::Serialize> serde::Serialize for $name<T> {
                fn serialize<S: serde::Serializer>(&self, serializer: S) -> ::core::result::Result<S::Ok, S::Error> {
                    #[derive(serde::Serialize)]
                    #[serde(crate = "serde")]
                    struct Fields<'a, T> { $($field: &'a T),* }
                    Fields { $($field: &self.$field),* }.serialize(serializer)
                }
            }
            impl<'de, T: serde::Deserialize<'de>> serde::Deserialize<'de> for $name<T> {
                fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> ::core::result::Result<Self, D::Error> {
                    #[derive(serde::Deserialize)]
                    #[serde(crate = "serde", deny_unknown_fields)]
                    struct Fields<T> { $($field: T),* }
                    let fields = Fields::deserialize(deserializer)?;
                    Ok($name { $($field: fields.$field),* })
                }
            }
        };
    )+};
}

#[doc(hidden)]
#[macro_export]
macro_rules! __count {
    () => { 0 };
    ($first:ident $($rest:ident)*) => { 1 + $crate::__count!($($rest)*) };
}

/// The empty vector: for models without state or without input.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Nothing;

impl Signals for Nothing {
    type Of<T: Entry> = Nothing;
    type Array<T: Entry> = [T; 0];
    const LEN: usize = 0;
    const NAMES: &'static [&'static str] = &[];
    const UNITS: &'static [&'static str] = &[];

    #[inline(always)]
    fn into_array<T: Entry>(_: Nothing) -> [T; 0] {
        []
    }
    #[inline(always)]
    fn from_array<T: Entry>(_: [T; 0]) -> Nothing {
        Nothing
    }
    #[inline(always)]
    fn array_from_fn<T: Entry>(_: impl FnMut(usize) -> T) -> [T; 0] {
        []
    }
}
