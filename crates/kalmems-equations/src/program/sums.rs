//! Sums and products as instructions.

use super::lower::{ProgramLowering, Stratum};
use super::op::OpKind;
use crate::graph::{ConstantBits, Node, NodeId};

impl ProgramLowering<'_> {
    pub(super) fn product(&mut self, factors: &[(NodeId, i32)], stratum: Stratum) -> u16 {
        if let Some(sum) = self.distributed(factors)
            && let Node::Sum { constant, terms } = self.graph.node(sum)
        {
            let others: Vec<_> = factors.iter().filter(|(factor, _)| *factor != sum).copied().collect();
            let registers = others.iter().map(|(f, power)| self.power(self.register(*f), *power)).collect();
            let multiplier = self.multiplied(registers);
            return self.sum(constant.get(), terms, stratum, multiplier);
        }
        let registers =
            factors.iter().map(|(factor, power)| self.power(self.register(*factor), *power)).collect();
        self.multiplied(registers).unwrap_or_default()
    }

    /// constant + Σ coefficient·term, all times what a product multiplies into it.
    pub(super) fn sum(
        &mut self,
        constant: f64,
        terms: &[(NodeId, ConstantBits)],
        stratum: Stratum,
        multiplier: Option<u16>,
    ) -> u16 {
        let mut sum = SumParts::default();
        // What changes more rarely than the sum is added up by itself.
        let mut rare = SumParts::default();
        if constant != 0.0 {
            let literal = self.literal(constant);
            match multiplier {
                Some(by) => rare.pairs.push([literal, by]),
                None => rare.singles.push(literal),
            }
        }
        for (term, coefficient) in terms {
            let factors = match self.fused(*term) {
                Some(factors) => factors,
                None => &[(*term, 1)],
            };
            let registers: Vec<u16> =
                factors.iter().map(|(factor, power)| self.power(self.register(*factor), *power)).collect();
            let (low, mut high): (Vec<u16>, Vec<u16>) =
                registers.into_iter().partition(|register| self.of_register(*register) < stratum);
            let mut scale: Vec<u16> = multiplier.into_iter().chain(low).collect();
            if *coefficient != ConstantBits::ONE {
                scale.push(self.literal(coefficient.get()));
            }
            // What is computed last is multiplied last.
            high.sort_unstable();
            let Some(last) = high.pop() else {
                let value = self.multiplied(scale);
                rare.singles.extend(value);
                continue;
            };
            let is_opposite =
                high.is_empty() && multiplier.is_none() && scale.len() == 1 && coefficient.get() == -1.0;
            scale.extend(high);
            match self.multiplied(scale) {
                _ if is_opposite => sum.opposites.push(last),
                Some(scale) => sum.pairs.push([scale, last]),
                None => sum.singles.push(last),
            }
        }
        if let Some(rare) = self.added(rare) {
            sum.singles.push(rare);
        }
        self.added(sum).unwrap_or_else(|| self.literal(0.0))
    }

    /// Σ singles − Σ opposites + Σ of the pairs' products.
    fn added(&mut self, mut parts: SumParts) -> Option<u16> {
        // What is computed last is added last.
        parts.pairs.sort_by_key(|[_, last]| *last);
        parts.singles.sort_unstable_by(|a, b| b.cmp(a));
        let mut pairs = parts.pairs.into_iter().peekable();
        let mut sum = None;
        if pairs.len() == 0 && parts.singles.is_empty() {
            let minus = (!parts.opposites.is_empty()).then(|| self.literal(-1.0));
            sum = minus
                .zip(parts.opposites.pop())
                .map(|(minus, last)| self.emit(OpKind::Multiply, &[minus, last]));
        } else if pairs.len() == 0 {
            sum = parts.singles.pop();
        }
        while pairs.len() > 0 {
            let before = sum.or_else(|| if pairs.len() == 3 { None } else { parts.singles.pop() });
            let take = match (before, pairs.len()) {
                (None, 3..) => 3,
                (_, 2..) => 2,
                _ => 1,
            };
            let mut operands: Vec<u16> = pairs.by_ref().take(take).flatten().collect();
            operands.extend(before);
            let kind = match (take, before) {
                (3, _) => OpKind::Products3,
                (2, Some(_)) => OpKind::Products2Add,
                (2, None) => OpKind::Products2,
                (_, Some(_)) => OpKind::MultiplyAdd,
                (_, None) => OpKind::Multiply,
            };
            sum = Some(self.emit(kind, &operands));
        }
        for single in parts.singles.into_iter().rev() {
            sum = Some(sum.map_or(single, |sum| self.emit(OpKind::Add, &[sum, single])));
        }
        for opposite in parts.opposites {
            sum = sum.map(|sum| self.emit(OpKind::Subtract, &[sum, opposite]));
        }
        sum
    }
}

/// What a sum is made of.
#[derive(Default)]
struct SumParts {
    singles: Vec<u16>,
    opposites: Vec<u16>,
    pairs: Vec<[u16; 2]>,
}
