//! Structures over a number: what a model holds, by index and by name.

use crate::Scalar;
use crate::notation::vector;
use core::fmt;

/// A structure that holds numbers of type `T` and can hold those of another type in their place.
///
/// Models are generic over the number that their parameters are held in, `Resonator<P>`; this trait goes from
/// `Resonator<f64>` to `Resonator<Dual>` parameter by parameter, which is how a parameter becomes a state of a
/// filter (see [`Augmented`](crate::Augmented)). The numbers are counted in the order of the fields, those of a
/// structure within in its place. A name is the way through the fields, `"resonator.stiffness"`.
///
/// `#[derive(Parameters)]` of `kalmems-macros` writes it. Numbers, `()`, arrays and tuples of numbers have it
/// too, so that the input of a model may be any of them.
///
/// ```
/// use kalmems_core::Parameters;
/// use kalmems_macros::Parameters;
/// #[derive(Parameters)]
/// struct Spring<P> {
///     stiffness: P,
///     damping: P,
/// }
/// #[derive(Parameters)]
/// struct Sensor<P> {
///     gain: P,
///     spring: Spring<P>,
/// }
/// let sensor = Sensor { gain: 2.0, spring: Spring { stiffness: 3.0, damping: 0.5 } };
/// assert_eq!(Sensor::<f64>::index_of("spring.damping"), Some(2));
/// assert_eq!(Sensor::<f64>::name(2).unwrap().to_string(), "spring.damping");
/// assert_eq!(sensor.value(2), Some(0.5));
/// // Rounded to f32, the stiffness three times as large.
/// let stiffer = sensor.map(|index, value| if index == 1 { 9.0_f32 } else { value as f32 });
/// assert_eq!((stiffer.gain, stiffer.spring.stiffness), (2.0, 9.0));
/// ```
#[diagnostic::on_unimplemented(
    note = "`#[derive(Parameters)]` of `kalmems_macros` writes it for a `struct Law<P>`"
)]
pub trait Parameters<T: Scalar> {
    /// The same structure over another number.
    type Of<S: Scalar>;

    /// How many numbers it holds.
    const COUNT: usize;

    /// The structure with `f(first + index, value)` instead of each number, called in their order.
    fn map_from<S: Scalar>(&self, first: usize, f: &mut impl FnMut(usize, T) -> S) -> Self::Of<S>;

    /// The index of the number with this name.
    fn index_of(name: &str) -> Option<usize>;

    /// Writes the name of the number with this index; nothing where there is none.
    fn write_name(index: usize, to: &mut dyn fmt::Write) -> fmt::Result;

    /// The structure with `f(index, value)` instead of each number.
    #[inline(always)]
    fn map<S: Scalar>(&self, mut f: impl FnMut(usize, T) -> S) -> Self::Of<S> {
        self.map_from(0, &mut f)
    }

    /// The name of the number with this index.
    fn name(index: usize) -> Option<ParameterName> {
        (index < Self::COUNT).then_some(ParameterName { index, write: Self::write_name })
    }

    /// The number with this index.
    fn value(&self, index: usize) -> Option<T> {
        let mut found = None;
        self.map(|i, value| {
            if i == index {
                found = Some(value);
            }
            value
        });
        found
    }
}

/// The name of a parameter, to be displayed.
#[derive(Clone, Copy, Debug)]
pub struct ParameterName {
    index: usize,
    write: fn(usize, &mut dyn fmt::Write) -> fmt::Result,
}

impl fmt::Display for ParameterName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (self.write)(self.index, f)
    }
}

/// A number: its name is empty, the field that holds it has one.
impl<T: Scalar> Parameters<T> for T {
    type Of<S: Scalar> = S;
    const COUNT: usize = 1;

    #[inline(always)]
    fn map_from<S: Scalar>(&self, first: usize, f: &mut impl FnMut(usize, T) -> S) -> S {
        f(first, *self)
    }
    fn index_of(name: &str) -> Option<usize> {
        name.is_empty().then_some(0)
    }
    fn write_name(_: usize, _: &mut dyn fmt::Write) -> fmt::Result {
        Ok(())
    }
}

/// Numbers in a row: their names are `"0"`, `"1"`, …
impl<T: Scalar, const K: usize> Parameters<T> for [T; K] {
    type Of<S: Scalar> = [S; K];
    const COUNT: usize = K;

    #[inline(always)]
    fn map_from<S: Scalar>(&self, first: usize, f: &mut impl FnMut(usize, T) -> S) -> [S; K] {
        vector!(|i| f(first + i, self[i]))
    }
    fn index_of(name: &str) -> Option<usize> {
        let is_index = !name.starts_with('+') && (name == "0" || !name.starts_with('0'));
        name.parse().ok().filter(|index| is_index && *index < K)
    }
    fn write_name(index: usize, to: &mut dyn fmt::Write) -> fmt::Result {
        if index < K { write!(to, "{index}") } else { Ok(()) }
    }
}

/// Nothing.
impl<T: Scalar> Parameters<T> for () {
    type Of<S: Scalar> = ();
    const COUNT: usize = 0;

    #[inline(always)]
    fn map_from<S: Scalar>(&self, _: usize, _: &mut impl FnMut(usize, T) -> S) {}
    fn index_of(_: &str) -> Option<usize> {
        None
    }
    fn write_name(_: usize, _: &mut dyn fmt::Write) -> fmt::Result {
        Ok(())
    }
}

/// Structures side by side; their parts have the names `"0"`, `"1"`, … of the tuple's fields.
macro_rules! tuple {
    ($($part:ident $field:tt),+) => {
        impl<T: Scalar, $($part: Parameters<T>),+> Parameters<T> for ($($part,)+) {
            type Of<S: Scalar> = ($($part::Of<S>,)+);
            const COUNT: usize = 0 $(+ $part::COUNT)+;

            #[inline(always)]
            fn map_from<S: Scalar>(&self, first: usize, f: &mut impl FnMut(usize, T) -> S) -> Self::Of<S> {
                let mut next = first;
                ($({
                    let here = next;
                    next += $part::COUNT;
                    let _ = next;
                    self.$field.map_from(here, f)
                },)+)
            }
            fn index_of(name: &str) -> Option<usize> {
                let (part, rest) = match name.split_once('.') {
                    Some((_, "")) => return None,
                    Some(split) => split,
                    None => (name, ""),
                };
                let mut first = 0;
                $(
                    if part == stringify!($field) {
                        return $part::index_of(rest).map(|index| first + index);
                    }
                    first += $part::COUNT;
                )+
                let _ = first;
                None
            }
            fn write_name(index: usize, to: &mut dyn fmt::Write) -> fmt::Result {
                let mut rest = index;
                $(
                    if rest < $part::COUNT {
                        to.write_str(stringify!($field))?;
                        if $part::index_of("").is_none() {
                            to.write_str(".")?;
                        }
                        return $part::write_name(rest, to);
                    }
                    rest -= $part::COUNT;
                )+
                let _ = rest;
                Ok(())
            }
        }
    };
}

tuple!(A 0, B 1);
tuple!(A 0, B 1, C 2);
