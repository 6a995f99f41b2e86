//! Operations on numbers of 32 bits, equal ones of which are one.

use crate::curve::CurveId;
use crate::graph::reached;
use std::borrow::Cow;
use std::collections::HashMap;

/// The place of an operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct TapeId(pub(super) u32);

impl TapeId {
    pub(super) fn index(self) -> usize {
        self.0 as usize
    }
}

/// A function that the source calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum CalledFunction {
    /// e^x where x ≤ 0.
    FallingExp,
    Exp,
    Ln,
    Sin,
    Cos,
    Tanh,
    Atanh,
    /// The arc tangent.
    Atan,
    Asin,
    Acos,
    Floor,
    Sqrt,
    /// A derivative of atanh(z)/z.
    Atanhc(u8),
    /// ln cosh x.
    LnCosh,
    /// A derivative of C/(ε₀·a) of two disks by their distance in radii.
    Disks(u8),
    /// A curve of the device or a derivative of it by its arguments, over its own spans and in its largest value.
    Curve(CurveId, [u8; 2]),
}

impl CalledFunction {
    /// What it is called where the source has it itself.
    pub(super) fn name(self) -> Cow<'static, str> {
        match self {
            Self::FallingExp => "falling_exp".into(),
            Self::Exp => "exp".into(),
            Self::Ln => "ln".into(),
            Self::Sin => "sin".into(),
            Self::Cos => "cos".into(),
            Self::Tanh => "tanh".into(),
            Self::Atanh => "atanh".into(),
            Self::Atan => "atan".into(),
            Self::Asin => "asin".into(),
            Self::Acos => "acos".into(),
            Self::Floor => "floor".into(),
            Self::Sqrt => "sqrt".into(),
            Self::Atanhc(_) => "atanhc".into(),
            Self::LnCosh => "ln_cosh".into(),
            Self::Disks(_) => "disks".into(),
            Self::Curve(curve, _) => format!("curve{curve}").into(),
        }
    }

    /// The order of its derivative by each argument, of one that is called with that.
    pub(super) fn order(self) -> Option<[u8; 2]> {
        match self {
            Self::Atanhc(order) | Self::Disks(order) => Some([order, 0]),
            Self::Curve(_, order) => Some(order),
            _ => None,
        }
    }
}

/// One operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum TapeOp {
    /// A number by its bits.
    Literal(u64),
    /// Something that has a name in the source.
    Name(u32),
    Add(TapeId, TapeId),
    Subtract(TapeId, TapeId),
    Multiply(TapeId, TapeId),
    Divide(TapeId, TapeId),
    Negative(TapeId),
    Call(CalledFunction, TapeId),
    CallOfTwo(CalledFunction, [TapeId; 2]),
    /// The third where the first is below the second, the fourth elsewhere.
    Choice([TapeId; 4]),
}

impl TapeOp {
    /// What it is made of.
    pub(super) fn parts(&self) -> Vec<TapeId> {
        match *self {
            Self::Literal(_) | Self::Name(_) => Vec::new(),
            Self::Add(a, b) | Self::Subtract(a, b) | Self::Multiply(a, b) | Self::Divide(a, b) => vec![a, b],
            Self::Negative(a) | Self::Call(_, a) => vec![a],
            Self::CallOfTwo(_, parts) => parts.to_vec(),
            Self::Choice(parts) => parts.to_vec(),
        }
    }

    /// About how many instructions it takes.
    pub(super) fn cost(&self) -> usize {
        match self {
            Self::Literal(_) | Self::Name(_) => 0,
            Self::Add(..) | Self::Subtract(..) | Self::Multiply(..) | Self::Negative(_) => 1,
            Self::Divide(..) => 10,
            Self::Call(..) => 25,
            Self::CallOfTwo(..) => 100,
            Self::Choice(_) => 4,
        }
    }
}

/// Operations in the order in which they can be computed.
#[derive(Clone, Debug, Default)]
pub(super) struct Tape {
    ops: Vec<TapeOp>,
    known: HashMap<TapeOp, TapeId>,
    names: Vec<String>,
}

impl Tape {
    pub(super) fn op(&self, id: TapeId) -> TapeOp {
        self.ops.get(id.index()).copied().unwrap_or(TapeOp::Literal(0))
    }

    pub(super) fn len(&self) -> usize {
        self.ops.len()
    }

    pub(super) fn name_of(&self, name: u32) -> &str {
        self.names.get(name as usize).map_or("", String::as_str)
    }

    fn push(&mut self, op: TapeOp) -> TapeId {
        if let Some(id) = self.known.get(&op) {
            return *id;
        }
        // Graphs are bounded far below that.
        let id = TapeId(u32::try_from(self.ops.len()).unwrap_or(u32::MAX));
        self.ops.push(op);
        self.known.insert(op, id);
        id
    }

    pub(super) fn literal(&mut self, value: f64) -> TapeId {
        self.push(TapeOp::Literal(if value == 0.0 { 0 } else { value.to_bits() }))
    }

    /// Something that has this name in the source.
    pub(super) fn named(&mut self, name: impl Into<String>) -> TapeId {
        let name = name.into();
        let place = self.names.iter().position(|known| *known == name).unwrap_or_else(|| {
            self.names.push(name);
            self.names.len() - 1
        });
        self.push(TapeOp::Name(u32::try_from(place).unwrap_or(u32::MAX)))
    }

    /// The number that this is.
    pub(super) fn number(&self, id: TapeId) -> Option<f64> {
        match self.op(id) {
            TapeOp::Literal(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    pub(super) fn is(&self, id: TapeId, value: f64) -> bool {
        self.number(id) == Some(value)
    }

    /// The opposite of what is a negative number times something.
    fn without_sign(&mut self, id: TapeId) -> Option<TapeId> {
        match self.op(id) {
            TapeOp::Multiply(x, y) if self.number(x).is_some_and(|x| x < 0.0) => {
                let x = self.number(x).unwrap_or_default();
                let x = self.literal(-x);
                Some(self.multiply(x, y))
            }
            _ => None,
        }
    }

    pub(super) fn add(&mut self, a: TapeId, b: TapeId) -> TapeId {
        if self.number(a).is_none_or(|a| a != 0.0)
            && let Some(b) = self.without_sign(b)
        {
            return self.subtract(a, b);
        }
        match (self.number(a), self.number(b), self.op(a), self.op(b)) {
            (Some(x), Some(y), ..) => self.literal(x + y),
            (Some(0.0), ..) => b,
            (_, Some(0.0), ..) => a,
            (_, _, _, TapeOp::Negative(b)) => self.push(TapeOp::Subtract(a, b)),
            (_, _, TapeOp::Negative(a), _) => self.push(TapeOp::Subtract(b, a)),
            (_, Some(y), ..) if y < 0.0 => {
                let y = self.literal(-y);
                self.push(TapeOp::Subtract(a, y))
            }
            _ => self.push(TapeOp::Add(a, b)),
        }
    }

    pub(super) fn subtract(&mut self, a: TapeId, b: TapeId) -> TapeId {
        if let Some(b) = self.without_sign(b) {
            return self.add(a, b);
        }
        match (self.number(a), self.number(b), self.op(b)) {
            (Some(x), Some(y), _) => self.literal(x - y),
            (_, Some(0.0), _) => a,
            (Some(0.0), ..) => self.negative(b),
            (_, _, TapeOp::Negative(b)) => self.add(a, b),
            (_, Some(y), _) if y < 0.0 => {
                let y = self.literal(-y);
                self.push(TapeOp::Add(a, y))
            }
            _ => self.push(TapeOp::Subtract(a, b)),
        }
    }

    pub(super) fn multiply(&mut self, a: TapeId, b: TapeId) -> TapeId {
        match (self.number(a), self.number(b), self.op(a), self.op(b)) {
            (Some(x), Some(y), ..) => self.literal(x * y),
            (Some(0.0), ..) | (_, Some(1.0), ..) => a,
            (_, Some(0.0), ..) | (Some(1.0), ..) => b,
            (Some(-1.0), ..) => self.negative(b),
            (_, Some(-1.0), ..) => self.negative(a),
            (Some(x), _, _, TapeOp::Negative(b)) => {
                let x = self.literal(-x);
                self.push(TapeOp::Multiply(x, b))
            }
            (None, Some(_), ..) => self.multiply(b, a),
            (_, _, TapeOp::Negative(x), _) => {
                let product = self.multiply(x, b);
                self.negative(product)
            }
            (_, _, _, TapeOp::Negative(y)) => {
                let product = self.multiply(a, y);
                self.negative(product)
            }
            // Numbers stand first.
            (Some(_), ..) => self.push(TapeOp::Multiply(a, b)),
            _ => self.push(TapeOp::Multiply(a.min(b), a.max(b))),
        }
    }

    pub(super) fn divide(&mut self, a: TapeId, b: TapeId) -> TapeId {
        match (self.number(a), self.number(b)) {
            (Some(x), Some(y)) => self.literal(x / y),
            (_, Some(1.0)) => a,
            _ => self.push(TapeOp::Divide(a, b)),
        }
    }

    pub(super) fn negative(&mut self, a: TapeId) -> TapeId {
        match self.op(a) {
            TapeOp::Literal(bits) => self.literal(-f64::from_bits(bits)),
            TapeOp::Negative(a) => a,
            TapeOp::Subtract(x, y) => self.subtract(y, x),
            TapeOp::Multiply(x, y) if self.number(x).is_some() => {
                let x = self.number(x).unwrap_or_default();
                let x = self.literal(-x);
                self.multiply(x, y)
            }
            _ => self.push(TapeOp::Negative(a)),
        }
    }

    pub(super) fn call(&mut self, called: CalledFunction, at: TapeId) -> TapeId {
        self.push(TapeOp::Call(called, at))
    }

    pub(super) fn call_of_two(&mut self, called: CalledFunction, at: [TapeId; 2]) -> TapeId {
        self.push(TapeOp::CallOfTwo(called, at))
    }

    pub(super) fn choice(&mut self, parts: [TapeId; 4]) -> TapeId {
        if parts[2] == parts[3] {
            return parts[2];
        }
        self.push(TapeOp::Choice(parts))
    }

    /// All operations that these need, each behind its parts.
    pub(super) fn below(&self, roots: &[TapeId]) -> Vec<TapeId> {
        let seen = reached((self.ops.len(), roots), TapeId::index, |id| self.op(id).parts());
        seen.map(TapeId).collect()
    }

    /// About how many instructions these take.
    pub(super) fn cost(&self, roots: &[TapeId]) -> usize {
        self.below(roots).iter().map(|id| self.op(*id).cost()).sum()
    }
}
