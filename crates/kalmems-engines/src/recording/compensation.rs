//! Columns that are compensated over the temperature, with the columns that this takes.

use super::findings::{FindingPlace, Findings};
use super::plan::TargetColumn;
use super::{DeclaredColumn, FindingKind as Kind};
use crate::config::TemperatureCurve;
use crate::config::layout::ColumnCompensation;
use crate::units::{Dimension, Unit, kind};

/// What a column is compensated for, with the places of the columns that this takes, which stand behind it.
pub(super) struct TargetCompensation {
    temperature: usize,
    bias: Option<TemperatureCurve>,
    scale_factor: Option<TemperatureCurve>,
    cross_axis: Vec<(usize, TemperatureCurve)>,
}

/// The columns with those behind them by which some of them are compensated. `declared` is what the settings say of a column of this name, and
/// `find` looks one up in the header.
pub(super) fn with_what_compensates<'a>(
    mut targets: Vec<TargetColumn>,
    line: usize,
    declared: impl Fn(&str) -> Option<&'a DeclaredColumn>,
    find: impl Fn(&DeclaredColumn, &mut Findings) -> Option<TargetColumn>,
    findings: &mut Findings,
) -> Vec<TargetColumn> {
    let mut hidden = Hidden { targets: &mut targets, line, find, findings };
    for place in 0..hidden.targets.len() {
        hidden.compensate(place, &declared, true);
    }
    targets
}

struct Hidden<'a, F> {
    targets: &'a mut Vec<TargetColumn>,
    line: usize,
    find: F,
    findings: &'a mut Findings,
}

impl<F: Fn(&DeclaredColumn, &mut Findings) -> Option<TargetColumn>> Hidden<'_, F> {
    fn push(&mut self, column: &DeclaredColumn) -> Option<usize> {
        let found = (self.find)(column, self.findings)?;
        self.targets.push(TargetColumn { is_hidden: true, ..found });
        Some(self.targets.len() - 1)
    }

    /// Gives the column at this place what the settings say of it; other columns enter without those that they depend on themselves.
    fn compensate<'a>(
        &mut self,
        place: usize,
        declared: &impl Fn(&str) -> Option<&'a DeclaredColumn>,
        with_others: bool,
    ) -> Option<()> {
        let known = declared(&self.targets.get(place)?.header.column)?;
        let Some(Ok(stated)) = &known.reading.as_ref()?.compensation else { return None };
        let ColumnCompensation { temperature, bias, scale_factor, cross_axis } = &**stated;
        let temperature = self.push(temperature)?;
        let mut others = Vec::new();
        for (name, curve) in cross_axis.iter().filter(|_| with_others) {
            let unnamed = || DeclaredColumn {
                column: name.clone(),
                key: "cross_axis".to_owned(),
                usual_unit: known.usual_unit,
                reading: None,
            };
            let other = declared(name).cloned().unwrap_or_else(unnamed);
            let other = self.push(&other)?;
            self.compensate(other, declared, false);
            others.push((other, curve.clone()));
        }
        let curves = bias.iter().chain(scale_factor).chain(others.iter().map(|(_, curve)| curve));
        let range = curves.fold([f64::NEG_INFINITY, f64::INFINITY], |[low, high], curve| {
            [low.max(curve.range_k[0]), high.min(curve.range_k[1])]
        });
        self.targets.get_mut(temperature)?.curve_range = Some(range);
        let compensation = TargetCompensation {
            temperature,
            bias: bias.clone(),
            scale_factor: scale_factor.clone(),
            cross_axis: others,
        };
        self.check(place, &compensation);
        self.targets.get_mut(place)?.compensation = Some(compensation);
        Some(())
    }

    /// Refuses curves of another dimension than the values'.
    fn check(&mut self, place: usize, of: &TargetCompensation) {
        let unit =
            |place: usize| self.targets.get(place).and_then(|target| target.header.unit).unwrap_or(Unit::ONE);
        let own = unit(place).dimension();
        let one = Unit::ONE.dimension();
        // The curve times the values of a column has to have the dimension of the compensated one.
        let wrong = |curve: &TemperatureCurve, of: Dimension| {
            let found = Unit::parse(&curve.unit).ok().map(|unit| unit.dimension().times(of));
            (found != Some(own))
                .then(|| format!("the curve `{}` is in `{}`, which does not fit", curve.name, curve.unit))
        };
        let bias = of.bias.iter().filter_map(|curve| wrong(curve, one));
        let scale_factor = of.scale_factor.iter().filter_map(|curve| wrong(curve, own));
        let cross_axis =
            of.cross_axis.iter().filter_map(|(other, curve)| wrong(curve, unit(*other).dimension()));
        let is_temperature = kind::TEMPERATURE.accepts(unit(of.temperature).dimension());
        let temperature =
            (!is_temperature).then(|| "the column `temperature` of `compensation` is none in K".to_owned());
        let faults: Vec<String> = bias.chain(scale_factor).chain(cross_axis).chain(temperature).collect();
        let column = self.targets.get(place).map(|target| target.index);
        let at = FindingPlace { column, segment: None, line: self.line };
        for fault in faults {
            self.findings.add(Kind::Contradiction, at, || fault);
        }
    }
}

/// The values of all columns in SI as they were measured become what they are compensated to.
pub(super) fn compensate(targets: &[TargetColumn], values: &mut [Vec<f64>]) {
    // What a column takes stands behind it, and is compensated before it.
    for (place, target) in targets.iter().enumerate().rev() {
        let Some(compensation) = &target.compensation else { continue };
        let Some((own, behind)) = values.split_at_mut_checked(place + 1) else { continue };
        let column = |at: usize| behind.get(at - place - 1).map_or(&[][..], Vec::as_slice);
        let temperatures = column(compensation.temperature);
        let at = |curve: &Option<TemperatureCurve>, usual: f64, kelvin: f64| {
            curve.as_ref().map_or(usual, |curve| curve.at(kelvin))
        };
        for (row, value) in own.last_mut().into_iter().flatten().enumerate() {
            let kelvin = temperatures.get(row).copied().unwrap_or(f64::NAN);
            let others = compensation.cross_axis.iter().map(|(other, curve)| {
                curve.at(kelvin) * column(*other).get(row).copied().unwrap_or(f64::NAN)
            });
            let bias = at(&compensation.bias, 0.0, kelvin) + others.sum::<f64>();
            *value = (*value - bias) / at(&compensation.scale_factor, 1.0, kelvin);
        }
    }
}
