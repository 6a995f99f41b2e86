//! Loops that are written out.

/// Runs a block for each index below a constant, written out for the first eight.
///
/// Blocks that evaluate a model, or sum up what several evaluations gave, are too large for an optimiser to unroll,
/// and as a closure of `array::from_fn` they are too large to be inlined: every number in them then lives in
/// memory, and a zero that is known in each turn is known no more.
macro_rules! unrolled {
    ($i:ident < $n:ident $body:block) => {
        $crate::linalg::unrolled!(@each $i, $n, $body, 0 1 2 3 4 5 6 7);
        for $i in 8..$n $body
    };
    (@each $i:ident, $n:ident, $body:block, $($k:literal)*) => {
        $(
            if $k < $n {
                let $i: usize = $k;
                $body
            }
        )*
    };
}

pub(crate) use unrolled;
