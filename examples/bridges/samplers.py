"""A likelihood of `kalmems.filters` with its gradient, as a function of JAX for NumPyro, and as an operation of PyTensor for PyMC.

    of = filters.likelihood(model, {"q": 0.1, "r": 1.0}, samples, positive=("q", "r"))

    numpyro.factor("samples", for_jax(of)(numbers))        # in a model of NumPyro
    pymc.Potential("samples", for_pymc(of)(numbers))       # in a model of PyMC

`numbers` is an array in the order of the second argument of `likelihood`, with the logarithms of the numbers in `positive`. JAX must compute in double
precision: `jax.config.update("jax_enable_x64", True)`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from kalmems import filters


def for_jax(of: filters.Likelihood) -> Any:
    """ln p of an array of JAX; JAX differentiates and compiles it."""
    import jax

    @jax.custom_vjp
    def log_likelihood(numbers: Any) -> Any:
        return jax.pure_callback(of, jax.ShapeDtypeStruct((), "float64"), numbers)

    def forward(numbers: Any) -> tuple[Any, Any]:
        return log_likelihood(numbers), numbers

    def backward(numbers: Any, by: Any) -> tuple[Any]:
        return (by * jax.pure_callback(of.gradient, jax.ShapeDtypeStruct(numbers.shape, "float64"), numbers),)

    log_likelihood.defvjp(forward, backward)
    return log_likelihood


def for_pymc(of: filters.Likelihood) -> Any:
    """ln p of a vector of PyTensor."""
    import pytensor.tensor as tensor
    from pytensor.graph.basic import Apply
    from pytensor.graph.op import Op

    class Gradient(Op):
        def make_node(self, numbers: Any) -> Apply:
            return Apply(self, [tensor.as_tensor_variable(numbers)], [tensor.dvector()])

        def perform(self, node: Apply, inputs: list[Any], outputs: list[Any]) -> None:
            outputs[0][0] = of.gradient(inputs[0])

    class LogLikelihood(Op):
        def make_node(self, numbers: Any) -> Apply:
            return Apply(self, [tensor.as_tensor_variable(numbers)], [tensor.dscalar()])

        def perform(self, node: Apply, inputs: list[Any], outputs: list[Any]) -> None:
            outputs[0][0] = np.array(of(inputs[0]))

        def grad(self, inputs: list[Any], output_gradients: list[Any]) -> list[Any]:
            return [output_gradients[0] * Gradient()(inputs[0])]

    return LogLikelihood()
