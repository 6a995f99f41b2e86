//! Readouts of the first state alone.

/// The [`Measurement`](kalmems_core::Measurement) of a readout whose `voltage` is a function of the first state.
macro_rules! of_first_state {
    ($readout:ident, $state:literal) => {
        #[model(parametric)]
        impl<T: Scalar, const N: usize> Measurement<T, N, 1> for $readout<T> {
            fn predict<S: Over<T>>(&self, x: &[S; N]) -> [S; 1] {
                const { assert!(N >= 1, concat!("the first state is the ", $state)) };
                [self.voltage(x[0])]
            }

            fn depends(_: usize, state: usize) -> bool {
                state == 0
            }

            /// One derivative, where dual numbers of all states would carry `N`.
            fn linearize(&self, x: &[T; N]) -> ([T; 1], Mat<T, 1, N>) {
                const { assert!(N >= 1, concat!("the first state is the ", $state)) };
                let y = self.voltage(Dual::<T, 1>::variable(x[0], 0));
                let mut jacobian = Mat::zero();
                [jacobian.0[0][0]] = y.gradient();
                ([y.value()], jacobian)
            }
        }
    };
}

pub(super) use of_first_state;
