"""Models: equations written as Python functions, which are read once."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from greybox import _core
from greybox._core import Parameter
from greybox.checks import shown
from greybox.errors import Error
from greybox.signals import Signals, SignalsLike, Vector, in_order, named
from greybox.symbols import Number, Symbol, Trace, called

__all__ = ["Equations", "Model", "model"]

#: What the arguments of a function are called.
_LETTERS = {"input": "u", "measured": "y", "parameter": "p"}

#: What a model's function returns: a vector, or a number for each quantity by name or in order.
Returned: TypeAlias = "Vector | Mapping[str, Number] | Sequence[Number] | np.ndarray[Any, np.dtype[Any]]"


class Model:
    """The equations of a system; derive a class of your own from it.

    A derived class declares its quantities by :func:`signals` (as attributes of the class, or of the instance) and writes its
    equations as methods:

    ========================== =======================================================================
    ``derivative(t, x, u, p)`` the derivative of each state; of a model in continuous time
    ``next(t, x, u, p)``       the next value of each state; of a model in discrete time
    ``jump(t, x, u, p)``       each state just after a sample, where samples change states of a model in continuous time
    ``output(t, x, u, p)``     each output; may be left out where all outputs are states
    ``diffusion(t, x, u, p)``  the intensity of the process noise of each state, for a Kalman predictor
    ``noise(t, x, u, p)``      the standard deviation of the noise of each output, for a Kalman predictor
    ``initial_noise(p)``       the standard deviation of each state at the first sample, for a Kalman predictor
    ``initial(u, p)``          the state at the first sample, where a record does not say it
    ``delay(p)``               the dead time of each input (s)
    ========================== =======================================================================

    ``t`` is the time (s), ``x``, ``u`` and ``p`` are vectors with entries by name. A model without ``derivative`` and ``next`` is
    static. The methods are called once for each fit, with symbols; what they read of the instance (``self.pole_pairs``) enters the
    equations as it is then.

    Attributes
    ----------
    states, inputs, outputs, parameters : Signals
        Names and units.

    Examples
    --------
    >>> import greybox as gb
    >>> class Tank(gb.Model):
    ...     states = outputs = gb.signals(h="m")
    ...     inputs = gb.signals(q="m^3/s")
    ...     parameters = gb.signals(area="m^2", outlet="m^2")
    ...
    ...     def derivative(self, t, x, u, p):
    ...         return x.like(h=(u.q - p.outlet * gb.sqrt(19.62 * x.h)) / p.area)
    >>> print(Tank().equations())
    d(h)/dt = (q - outlet * sqrt(h * 19.62)) / area
    output h = h
    """

    states: SignalsLike = Signals({})
    inputs: SignalsLike = Signals({})
    outputs: SignalsLike = Signals({})
    parameters: SignalsLike = Signals({})

    def derivative(self, t: Symbol, x: Vector, u: Vector, p: Vector) -> Returned:
        """Give the derivative of each state."""
        raise NotImplementedError(f"{type(self).__name__} has no method derivative(self, t, x, u, p)")

    def next(self, t: Symbol, x: Vector, u: Vector, p: Vector) -> Returned:
        """Give the next value of each state."""
        raise NotImplementedError(f"{type(self).__name__} has no method next(self, t, x, u, p)")

    def jump(self, t: Symbol, x: Vector, u: Vector, p: Vector) -> Returned:
        """Give each state just after a sample, from that before it."""
        raise NotImplementedError(f"{type(self).__name__} has no method jump(self, t, x, u, p)")

    def output(self, t: Symbol, x: Vector, u: Vector, p: Vector) -> Returned:
        """Give each output: the states of these names, unless a model says otherwise."""
        names = tuple(named(self.outputs, "outputs"))
        missing = [name for name in names if name not in x.keys()]
        if missing:
            raise Error(f"{type(self).__name__}: output `{missing[0]}` is no state; write the method output(self, t, x, u, p)")
        return [x[name] for name in names]

    def diffusion(self, t: Symbol, x: Vector, u: Vector, p: Vector) -> Returned:
        """Give the intensity of the process noise of each state."""
        raise NotImplementedError(f"{type(self).__name__} has no method diffusion(self, t, x, u, p)")

    def noise(self, t: Symbol, x: Vector, u: Vector, p: Vector) -> Returned:
        """Give the standard deviation of the noise of each output."""
        raise NotImplementedError(f"{type(self).__name__} has no method noise(self, t, x, u, p)")

    def initial_noise(self, p: Vector) -> Returned:
        """Give the standard deviation of each state at the first sample."""
        raise NotImplementedError(f"{type(self).__name__} has no method initial_noise(self, p)")

    def initial(self, u: Vector, p: Vector) -> Returned:
        """Give the state at the first sample, from the inputs there; NaN of a state that is estimated."""
        raise NotImplementedError(f"{type(self).__name__} has no method initial(self, u, p)")

    def delay(self, p: Vector) -> Returned:
        """Give the dead time of each input (s)."""
        raise NotImplementedError(f"{type(self).__name__} has no method delay(self, p)")

    def equations(self) -> Equations:
        """Read the model.

        Raises
        ------
        TraceError
            If its code asks a symbol for what only a number has, or returns other quantities than those declared.
        Error
            If its quantities are not declared.
        """
        return _read(self)


class Equations(Model):
    """A model that has been read: quantities and arithmetic as data. It is printed by ``str`` and kept by pickle."""

    def __init__(self, core: _core.Equations) -> None:
        self.core = core
        self.kind = core.kind
        self.states = Signals(dict(core.states))
        self.inputs = Signals(dict(core.inputs))
        self.outputs = Signals(dict(core.outputs))
        self.parameters = Signals(dict(core.parameters))

    def equations(self) -> Equations:
        """Give the equations themselves."""
        return self

    @property
    def declared(self) -> dict[str, Parameter]:
        """The declarations of parameters that come with the model: those of a model file."""
        return {}

    def defaults(self) -> dict[str, Any]:
        """Give the options that come with the model."""
        return {}

    def prepared(self, record: _core.Record) -> _core.Record:
        """Give a record with what the model says of holds and initial states."""
        return record

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Equations) and self.core == other.core

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return (Equations, (self.core,))

    def __str__(self) -> str:
        return str(self.core).rstrip("\n")

    def __repr__(self) -> str:
        sizes = (f"{len(named(of, what))} {what}" for what, of in _roles(self))
        return f"<Equations: {self.kind}, {', '.join(sizes)}>"


class _Functions(Model):
    """A model of functions."""

    def __init__(self, functions: Mapping[str, Callable[..., Returned]], quantities: Mapping[str, SignalsLike]) -> None:
        self.functions = dict(functions)
        for role, of in quantities.items():
            setattr(self, role, named(of, role))

    def __reduce__(self) -> tuple[Any, ...]:
        # Functions without a name of their own, such as lambdas, have no pickle; the equations that they are read as have.
        return self.equations().__reduce__()


def model(
    derivative: Callable[..., Returned] | None = None,
    *,
    next: Callable[..., Returned] | None = None,
    jump: Callable[..., Returned] | None = None,
    output: Callable[..., Returned] | None = None,
    diffusion: Callable[..., Returned] | None = None,
    noise: Callable[..., Returned] | None = None,
    initial_noise: Callable[..., Returned] | None = None,
    initial: Callable[..., Returned] | None = None,
    delay: Callable[..., Returned] | None = None,
    states: SignalsLike = (),
    inputs: SignalsLike = (),
    outputs: SignalsLike = (),
    parameters: SignalsLike = (),
) -> Model:
    """Make a model of functions ``f(t, x, u, p)``, without a class.

    Parameters
    ----------
    derivative, next, jump, output, diffusion, noise : callable, optional
        As the methods of :class:`Model`, without ``self``.
    initial_noise, delay : callable, optional
        The same, of ``p`` alone.
    initial : callable, optional
        The same, of ``u`` and ``p``.
    states, inputs, outputs, parameters : Signals, mapping from names to units, or names
        The quantities.

    Examples
    --------
    >>> import greybox as gb
    >>> cooling = gb.model(
    ...     lambda t, x, u, p: [p.k * (u.room - x.body)], states={"body": "K"}, inputs={"room": "K"}, outputs={"body": "K"},
    ...     parameters={"k": "1/s"},
    ... )
    >>> print(cooling.equations())
    d(body)/dt = k * (room - body)
    output body = body
    """
    levels = {"diffusion": diffusion, "noise": noise, "initial_noise": initial_noise, "initial": initial, "delay": delay}
    functions = {"derivative": derivative, "next": next, "jump": jump, "output": output, **levels}
    given = {name: function for name, function in functions.items() if function is not None}
    return _Functions(given, {"states": states, "inputs": inputs, "outputs": outputs, "parameters": parameters})


def checked(of: Any) -> Model:
    """Give what is a model.

    Raises
    ------
    Error
        If it is none.
    """
    if isinstance(of, Model):
        return of
    if isinstance(of, type) and issubclass(of, Model):
        raise Error(f"the model is the class {of.__name__}; make one of it: {of.__name__}()")
    raise Error(f"the model is {type(of).__name__}; derive a class from gb.Model, or make one of functions: gb.model(f, states=..., ...)")


def _roles(of: Model) -> list[tuple[str, SignalsLike]]:
    return [("states", of.states), ("inputs", of.inputs), ("outputs", of.outputs), ("parameters", of.parameters)]


def _written(of: Model, name: str) -> Callable[..., Returned] | None:
    """Give a function of the model, if it is written."""
    if isinstance(of, _Functions):
        return of.functions.get(name)
    method: Callable[..., Returned] = getattr(of, name)
    own = getattr(type(of), name, None) is not getattr(Model, name)
    return method if own or name in vars(of) else None


def _read(of: Model) -> Equations:
    title = "the model" if isinstance(of, _Functions) else type(of).__name__
    quantities = {role: named(signals, role) for role, signals in _roles(of)}
    derivative, following = _written(of, "derivative"), _written(of, "next")
    if derivative and following:
        raise Error(f"{title} has derivative and next; write one: a model is in continuous or in discrete time")
    if _written(of, "jump") and not derivative:
        raise Error(f"{title} has jump and no derivative; a jump is what a sample changes in a model in continuous time")
    kind = "continuous" if derivative else "discrete" if following else "static"
    if kind == "static" and quantities["states"]:
        raise Error(f"{title} has states and neither derivative(t, x, u, p) nor next(t, x, u, p); write one")
    initial = [f"{name}(0)" for name in quantities["states"] if f"{name}(0)" in quantities["parameters"]]
    if initial:
        raise Error(f"{title} has the parameter `{initial[0]}`, which is the name of the state at the first sample; rename the parameter")
    if not quantities["outputs"]:
        raise Error(f"{title} has no outputs; declare what is measured: outputs = gb.signals(name=\"unit\")")
    trace = Trace()
    try:
        roots = _roots(of, title, trace, quantities, derivative or following)
        core = _core.Equations(kind, [list(one.items()) for one in quantities.values()], trace.graph, roots)
    finally:
        trace.open = False
    return Equations(core)


def _roots(
    of: Model,
    title: str,
    trace: Trace,
    quantities: Mapping[str, Signals],
    state: Callable[..., Returned] | None,
) -> list[list[_core.Node]]:
    graph = trace.graph
    t = Symbol(trace, graph.time())

    def vector(role: str, leaf: Callable[[int], _core.Node]) -> Vector:
        names = quantities[role]
        return Vector(role, names, [Symbol(trace, leaf(i)) for i in range(len(names))])

    x, u, p = vector("states", graph.state), vector("inputs", graph.input), vector("parameters", graph.parameter)
    output = _written(of, "output") or (lambda *args: Model.output(of, *args))
    levels = {"diffusion": "states", "noise": "outputs"}

    def nodes(role: str, function: Callable[..., Returned] | None, name: str, *args: Any) -> list[_core.Node]:
        if function is None:
            return []
        _check_call(function, f"{name} of {title}", {1: "p", 2: "u, p"}.get(len(args), "t, x, u, p"))
        return _returned(trace, called(function, *args), tuple(quantities[role]), f"{name} of {title}")

    name = "derivative" if _written(of, "derivative") else "next"
    return [
        nodes("states", state, name, t, x, u, p),
        nodes("outputs", output, "output", t, x, u, p),
        *(nodes(role, _written(of, name), name, t, x, u, p) for name, role in levels.items()),
        nodes("states", _written(of, "initial_noise"), "initial_noise", p),
        nodes("states", _written(of, "initial"), "initial", u, p),
        nodes("inputs", _written(of, "delay"), "delay", p),
        nodes("states", _written(of, "jump"), "jump", t, x, u, p),
    ]


def _check_call(function: Any, what: str, given: str) -> None:
    """Refuse what cannot be called with the arguments of these names."""
    if not callable(function):
        raise Error(f"{what} is {shown(function)}; give a function of {given}")
    try:
        inspect.signature(function).bind(*given.split(", "))
    except (TypeError, ValueError) as error:
        raise Error(f"{what} cannot be called with ({given}), which are handed over: {error}") from None


def _returned(trace: Trace, found: Any, names: tuple[str, ...], where: str) -> list[_core.Node]:
    """Give the nodes of what a function returned."""
    entries: Iterable[Any]
    if isinstance(found, Vector):
        found = dict(zip(found.keys(), found, strict=True))
    if isinstance(found, Mapping):
        entries = in_order(found, names, where)
    elif found is None:
        raise Error(f"{where} returns nothing; return a value for each of {', '.join(names)}")
    elif isinstance(found, np.ndarray):
        entries = found.ravel().tolist()
    else:
        entries = found if isinstance(found, (list, tuple)) else [found]
    entries = list(entries)
    if len(entries) != len(names):
        raise Error(f"{where} returns {len(entries)} value(s), but there are {len(names)} to give: {', '.join(names)}")
    nodes: list[_core.Node] = []
    for name, entry in zip(names, entries, strict=True):
        if isinstance(entry, (list, tuple)) or (isinstance(entry, np.ndarray) and entry.ndim > 0):
            raise Error(f"{where}: the value of `{name}` has the shape {np.shape(entry)}; return one number for each")
        nodes.append(trace.node(entry))
    return nodes


def of_sample(equations: Equations, function: Callable[..., Any]) -> _core.Expression:
    """Read a function of time, inputs and measured outputs."""
    return _expression(function, "the weighting", equations, [("inputs", "input"), ("outputs", "measured")], time=True)


def of_parameters(equations: Equations, function: Callable[..., Any]) -> _core.Expression:
    """Read a function of the parameters."""
    return _expression(function, "the derived quantity", equations, [("parameters", "parameter")], time=False)


def _expression(
    function: Callable[..., Any], what: str, equations: Equations, roles: list[tuple[str, str]], *, time: bool
) -> _core.Expression:
    _check_call(function, what, ", ".join([*(["t"] if time else []), *(_LETTERS[leaf] for _, leaf in roles)]))
    trace = Trace()
    arguments: list[Any] = [Symbol(trace, trace.graph.time())] if time else []
    for role, leaf in roles:
        names = named(getattr(equations, role), role)
        arguments.append(Vector(role, names, [Symbol(trace, getattr(trace.graph, leaf)(i)) for i in range(len(names))]))
    try:
        (node,) = _returned(trace, called(function, *arguments), ("value",), what)
        return _core.Expression(trace.graph, node)
    finally:
        trace.open = False
