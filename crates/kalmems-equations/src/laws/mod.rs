//! The published laws as functions of the language.
//!
//! Laws with an exponential, a root or a series are nodes of their own, computed by `kalmems-models` with their
//! derivatives; those that are a line of arithmetic are written in the language itself.

pub(crate) mod disks;
mod native;
mod prelude;

pub(crate) use native::{MOST_ARGUMENTS, along_first, along_first_of_four, gaussian_along_first, partial};
pub(crate) use prelude::PRELUDE;

use crate::quantity::UnitKnowledge;
use kalmems_units::Unit;

/// A native law, by its place in [`LAWS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum LawId {
    GaussianComb,
    LogisticComb,
    LogisticCombChange,
    TiltingPlate,
    Carrier,
    Disks,
    Atanhc,
}

/// What unit an argument must have.
#[derive(Clone, Copy, Debug)]
pub(crate) enum ArgumentUnit {
    /// This one.
    Unit(&'static str),
    /// Any, which others refer to.
    Free,
    /// That of another argument, angle included.
    As(usize),
    /// One over that of another argument, angle included.
    Inverse(usize),
}

/// A native law as texts use it.
pub(crate) struct Law {
    pub(crate) id: LawId,
    pub(crate) name: &'static str,
    pub(crate) arguments: &'static [(&'static str, ArgumentUnit)],
    /// The unit of the value: a unit, or that of an argument.
    pub(crate) value: ArgumentUnit,
    /// The law as a reader knows it.
    pub(crate) formula: &'static str,
}

/// All native laws.
pub(crate) static LAWS: &[Law] = &[
    Law {
        id: LawId::GaussianComb,
        name: "gaussian_comb",
        arguments: &[
            ("angle", ArgumentUnit::Free),
            ("nominal", ArgumentUnit::Free),
            ("width", ArgumentUnit::As(0)),
            ("bias", ArgumentUnit::As(1)),
        ],
        value: ArgumentUnit::As(1),
        formula: "nominal·exp(−(angle/width)²) + bias",
    },
    Law {
        id: LawId::LogisticComb,
        name: "logistic_comb",
        arguments: &[
            ("angle", ArgumentUnit::Free),
            ("centre", ArgumentUnit::As(0)),
            ("gain", ArgumentUnit::Free),
            ("steepness", ArgumentUnit::Inverse(0)),
        ],
        value: ArgumentUnit::As(2),
        formula: "gain·(1/(1 + exp(−u)) − 1/2), u = steepness·(angle − centre)",
    },
    Law {
        id: LawId::LogisticCombChange,
        name: "logistic_comb_change",
        arguments: &[
            ("angle", ArgumentUnit::Unit("rad")),
            ("centre", ArgumentUnit::Unit("rad")),
            ("gain", ArgumentUnit::Unit("V s/rad")),
            ("steepness", ArgumentUnit::Unit("1/rad")),
            ("transimpedance", ArgumentUnit::Unit("V ohm")),
        ],
        value: ArgumentUnit::Unit("F"),
        formula: "−∫logistic_comb/transimpedance over the angle, from centre to angle",
    },
    Law {
        id: LawId::TiltingPlate,
        name: "tilting_plate",
        arguments: &[
            ("angle", ArgumentUnit::Unit("rad")),
            ("near", ArgumentUnit::Unit("m")),
            ("far", ArgumentUnit::Unit("m")),
            ("along", ArgumentUnit::Unit("m")),
            ("gap", ArgumentUnit::Unit("m")),
            ("permittivity", ArgumentUnit::Unit("F/m")),
        ],
        value: ArgumentUnit::Unit("F"),
        formula: "permittivity·along·∫dw/(gap − w·tan angle), w from near to far",
    },
    Law {
        id: LawId::Carrier,
        name: "carrier",
        arguments: &[
            ("capacitance", ArgumentUnit::Unit("F")),
            ("excitation", ArgumentUnit::Free),
            ("carrier_rate", ArgumentUnit::Unit("rad/s")),
            ("shunt_conductance", ArgumentUnit::Unit("S")),
            ("parallel_capacitance", ArgumentUnit::Unit("F")),
            ("input_conductance", ArgumentUnit::Unit("S")),
            ("blocking_capacitance", ArgumentUnit::Unit("F")),
        ],
        value: ArgumentUnit::As(1),
        formula: "amplitude of the carrier after capacitance into shunt, parallel and blocking capacitance and input",
    },
    Law {
        id: LawId::Disks,
        name: "disks",
        arguments: &[("distance", ArgumentUnit::Unit("m")), ("radius", ArgumentUnit::Unit("m"))],
        value: ArgumentUnit::Unit("F"),
        formula: "two equal coaxial disks with their fringing field (Love, 1949)",
    },
    Law {
        id: LawId::Atanhc,
        name: "atanhc",
        arguments: &[("z", ArgumentUnit::Unit("1"))],
        value: ArgumentUnit::Unit("1"),
        formula: "atanh(z)/z",
    },
];

/// The law of this name.
pub(crate) fn of_name(name: &str) -> Option<&'static Law> {
    LAWS.iter().find(|law| law.name == name)
}

/// The name of a law.
pub(crate) fn name(id: LawId) -> &'static str {
    LAWS.iter().find(|law| law.id == id).map_or("", |law| law.name)
}

/// The highest order of a derivative by these arguments: one more where the first argument is among them, whose derivative
/// the models state.
pub(crate) fn highest_order(by: &[u8]) -> usize {
    if by.contains(&0) { 3 } else { 2 }
}

/// Whether a law has this derivative.
pub(crate) fn has_derivative(_: LawId, by: &[u8]) -> bool {
    by.len() <= highest_order(by)
}

impl Law {
    /// The unit of the value; or which argument has a wrong one, its own, the one wanted and why.
    pub(crate) fn check(&self, found: &[UnitKnowledge]) -> Result<UnitKnowledge, (usize, String, String)> {
        for (index, ((_, wanted), have)) in self.arguments.iter().zip(found).enumerate() {
            let (expected, because) = match wanted {
                ArgumentUnit::Free => continue,
                ArgumentUnit::Unit(unit) => (unit_of(unit), format!("`{}` expects there", self.name)),
                ArgumentUnit::As(other) => {
                    (Some(at(found, *other)), format!("`{}` has", self.argument(*other)))
                }
                ArgumentUnit::Inverse(other) => (
                    UnitKnowledge::PLAIN.over(at(found, *other)),
                    format!("is one over that of `{}`", self.argument(*other)),
                ),
            };
            let expected = expected.unwrap_or(UnitKnowledge::Any);
            // Sensitivities and rates are written with rad and without; shapes are not.
            let strict =
                !matches!(wanted, ArgumentUnit::Unit(unit) if !matches!(*unit, "rad" | "1/rad" | "1"));
            let fits = match (*have, expected) {
                (UnitKnowledge::Any, _) | (_, UnitKnowledge::Any) => true,
                (UnitKnowledge::Exact(a), UnitKnowledge::Exact(b)) if strict => a == b,
                _ => have.plus(expected).is_some(),
            };
            if !fits {
                return Err((index, expected.to_string(), because));
            }
        }
        Ok(match self.value {
            ArgumentUnit::Unit(unit) => unit_of(unit).unwrap_or(UnitKnowledge::Any),
            ArgumentUnit::As(other) | ArgumentUnit::Inverse(other) => at(found, other),
            ArgumentUnit::Free => UnitKnowledge::Any,
        })
    }

    /// The law with the names of its arguments.
    pub(crate) fn header(&self) -> String {
        let names: Vec<&str> = self.arguments.iter().map(|(name, _)| *name).collect();
        format!("{}({})", self.name, names.join(", "))
    }

    pub(crate) fn argument(&self, index: usize) -> &'static str {
        self.arguments.get(index).map_or("", |(name, _)| name)
    }
}

fn at(found: &[UnitKnowledge], index: usize) -> UnitKnowledge {
    found.get(index).copied().unwrap_or(UnitKnowledge::Any)
}

fn unit_of(unit: &str) -> Option<UnitKnowledge> {
    Unit::parse(unit).ok().map(|unit| UnitKnowledge::Exact(unit.dimension()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_of_a_law_is_one() {
        for law in LAWS {
            assert!(law.arguments.len() <= MOST_ARGUMENTS, "{}", law.name);
            for wanted in law.arguments.iter().map(|(_, wanted)| wanted).chain([&law.value]) {
                if let ArgumentUnit::Unit(unit) = wanted {
                    assert!(unit_of(unit).is_some(), "{}: {unit}", law.name);
                }
            }
            assert_eq!(name(law.id), law.name);
        }
    }
}
