//! What several filters have in common.

/// The accessors of a [`Filter`](super::Filter) that holds a `state`, whose covariance is a field or a method of it.
macro_rules! held_state {
    ($($covariance:tt)+) => {
        /// The mean of the state.
        #[inline(always)]
        fn mean(&self) -> &[T; N] {
            &self.state.mean
        }

        /// The covariance of the state.
        #[inline(always)]
        fn covariance(&self) -> Covariance<T, N> {
            self.state.$($covariance)+
        }
    };
}

/// The part of a [`Filter`](super::Filter) that holds a `state: Gaussian` and predicts by its model linearised at the mean;
/// how it corrects is its own. A macro, because a trait for all of them would leave no room for other filters.
macro_rules! linearized_filter {
    () => {
        $crate::filter::linearized::held_state!(covariance);

        /// Moves the state by one step: f(x, u), F·P·Fᵀ + Q.
        #[inline(always)]
        fn predict_linked<P: NumericProcess<T, N>>(
            &mut self,
            process: &P,
            u: &P::Input,
        ) -> Result<StateTransition<T, N>, FilterError> {
            self.state.propagate(process, u)
        }
    };
}

pub(super) use {held_state, linearized_filter};
