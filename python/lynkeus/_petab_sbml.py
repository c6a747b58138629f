"""Models in SBML, without events, as equations."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from ._optional import needed
from ._petab_math import Expr, Reader, number, over, symbol, times, total
from .errors import InputError


#: packages of SBML that change what the equations are; `comp` where it has submodels
FOREIGN = frozenset(("arrays", "comp", "distrib", "dyn", "multi", "qual", "spatial"))


@dataclass
class Quantity:
    """A compartment, a species or a parameter of a model."""

    id: str
    #: "compartment", "species" or "parameter"
    kind: str
    constant: bool
    #: where it starts, or its value
    initial: Expr | None = None
    #: by an initial assignment, or a value that stands in the model: only the first may name what starts
    is_assigned: bool = False
    #: "assignment" or "rate", and the formula of it
    rule: tuple[str, Expr] | None = None
    compartment: str = ""
    #: of a species: an amount in all formulas, else a concentration
    is_amount: bool = False
    #: of a species: reactions do not change it
    is_boundary: bool = False
    #: of a species: the start that the model gives is an amount
    starts_as_amount: bool = False
    factor: str = ""


@dataclass
class Reaction:
    """A reaction: what it changes by how much, and how fast."""

    id: str
    rate: Expr
    changes: list[tuple[str, Expr]] = field(default_factory=list)


class Sbml:
    """What a model says, with formulas in which functions and local parameters are written out.

    Raises
    ------
    InputError
        It cannot be read, or has what no plant of Lynkeus has: events, algebraic rules, delays, fast reactions.
    """

    def __init__(self, path: str | os.PathLike[str], document: Any | None = None) -> None:
        self.file = os.fspath(path)
        sbml = needed("libsbml", "lynkeus.petab")
        self.sbml = sbml
        self.document = sbml.readSBMLFromFile(self.file) if document is None else document
        self._refuse_errors()
        self.model = self.document.getModel()
        if self.model is None:
            raise self.refused("there is no model in it")
        self.name = self.model.getId() or "Problem"
        self._refuse_foreign()
        self.functions: dict[str, tuple[list[str], Expr]] = {}
        for one in self.model.getListOfFunctionDefinitions():
            names = [one.getArgument(i).getName() for i in range(one.getNumArguments())]
            self.functions[one.getId()] = (names, self._read(one.getBody(), f"function {one.getId()}"))
        self.quantities: dict[str, Quantity] = {one.id: one for one in self._quantities()}
        self._take_assignments()
        self.reactions: list[Reaction] = [self._reaction(one) for one in self.model.getListOfReactions()]
        self._write_out_rates()

    def refused(self, what: str) -> InputError:
        return InputError(f"{self.file}: {what}")

    def _refuse_errors(self) -> None:
        log = self.document.getErrorLog()
        for i in range(log.getNumErrors()):
            error = log.getError(i)
            if error.getSeverity() >= self.sbml.LIBSBML_SEV_ERROR:
                raise self.refused(f"line {error.getLine()}: {error.getMessage().strip()}")

    def _refuse_foreign(self) -> None:
        """What has no equations here."""
        model = self.model
        for i in range(self.document.getNumPlugins()):
            package = self.document.getPlugin(i).getPackageName()
            parts = model.getPlugin("comp") if package == "comp" else None
            if package in FOREIGN and (parts is None or parts.getNumSubmodels() > 0):
                raise self.refused(f'the package "{package}" of SBML, which is not read')
        for event in model.getListOfEvents():
            raise self.refused(f'the event "{event.getId()}": expected a model without events')
        for rule in model.getListOfRules():
            if rule.isAlgebraic():
                raise self.refused("an algebraic rule: write it as an assignment rule")
        for reaction in model.getListOfReactions():
            if reaction.isSetFast() and reaction.getFast():
                raise self.refused(f'the fast reaction "{reaction.getId()}"')

    def _read(self, node: Any, place: str) -> Expr:
        return Reader(f"{self.file}: {place}", getattr(self, "functions", {})).read(node)

    def _quantities(self) -> Iterator[Quantity]:
        for one in self.model.getListOfCompartments():
            size = number(one.getSize()) if one.isSetSize() else None
            if size is None and one.getSpatialDimensions() == 0:
                size = number(1.0)
            yield Quantity(one.getId(), "compartment", one.getConstant(), size)
        for one in self.model.getListOfSpecies():
            initial = None
            if one.isSetInitialAmount():
                initial = number(one.getInitialAmount())
            elif one.isSetInitialConcentration():
                initial = number(one.getInitialConcentration())
            yield Quantity(
                one.getId(),
                "species",
                one.getConstant(),
                initial,
                compartment=one.getCompartment(),
                is_amount=one.getHasOnlySubstanceUnits(),
                is_boundary=one.getBoundaryCondition(),
                starts_as_amount=one.isSetInitialAmount(),
                factor=one.getConversionFactor() or self.model.getConversionFactor() or "",
            )
        for one in self.model.getListOfParameters():
            value = number(one.getValue()) if one.isSetValue() else None
            yield Quantity(one.getId(), "parameter", one.getConstant(), value)

    def _take_assignments(self) -> None:
        for one in self.model.getListOfInitialAssignments():
            own = self._meant(one.getSymbol(), "an initial assignment")
            own.initial = self._read(one.getMath(), f"the initial assignment of {own.id}")
            own.is_assigned = True
        for one in self.model.getListOfRules():
            own = self._meant(one.getVariable(), "a rule")
            kind = "rate" if one.isRate() else "assignment"
            own.rule = (kind, self._read(one.getMath(), f"the rule of {own.id}"))

    def _meant(self, name: str, what: str) -> Quantity:
        if name not in self.quantities:
            raise self.refused(f'{what} of "{name}", which is no compartment, species or parameter')
        return self.quantities[name]

    def _reaction(self, one: Any) -> Reaction:
        law = one.getKineticLaw()
        if law is None or law.getMath() is None:
            raise self.refused(f'the reaction "{one.getId()}" has no kinetic law')
        place = f"the rate of {one.getId()}"
        rate = self._read(law.getMath(), place)
        own: dict[str, Expr] = {}
        for some in (law.getListOfParameters(), law.getListOfLocalParameters()):
            for local in some:
                if not local.isSetValue():
                    raise self.refused(f'{place}: its parameter "{local.getId()}" has no value')
                own[local.getId()] = number(local.getValue())
        made = Reaction(one.getId(), rate.put(own))
        for sign, some in ((-1.0, one.getListOfReactants()), (1.0, one.getListOfProducts())):
            for other in some:
                made.changes.append((other.getSpecies(), self._share(other, sign, one.getId())))
        return made

    def _share(self, reference: Any, sign: float, reaction: str) -> Expr:
        """How much of a species a reaction makes."""
        species = reference.getSpecies()
        place = f"the stoichiometry of {species} in {reaction}"
        if reference.getId() and (
            self.model.getRule(reference.getId()) or self.model.getInitialAssignment(reference.getId())
        ):
            raise self.refused(f"{place} is not a number")
        if reference.isSetStoichiometryMath():
            found = self._read(reference.getStoichiometryMath().getMath(), place)
            return found if sign > 0 else Expr("neg", (found,))
        value = reference.getStoichiometry()
        return number(sign * (1.0 if value != value else value))

    def _write_out_rates(self) -> None:
        """Formulas may name reactions: their rates."""
        rates = {one.id: one.rate for one in self.reactions if one.id and one.id not in self.quantities}
        for _ in range(len(rates)):
            known = {name: rate.put(rates) for name, rate in rates.items()}
            if known == rates:
                break
            rates = known
        for reaction in self.reactions:
            reaction.rate = reaction.rate.put(rates)
        for own in self.quantities.values():
            if own.initial is not None:
                own.initial = own.initial.put(rates)
            if own.rule is not None:
                own.rule = (own.rule[0], own.rule[1].put(rates))

    def is_state(self, own: Quantity) -> bool:
        """Whether it has a derivative."""
        if own.rule is not None:
            return own.rule[0] == "rate"
        if own.kind != "species" or own.constant or own.is_boundary:
            return False
        return any(name == own.id for reaction in self.reactions for name, _ in reaction.changes)

    def derivative(self, own: Quantity) -> Expr:
        """Of a state; of one with reactions that of the amount."""
        if own.rule is not None:
            return own.rule[1]
        terms = [
            times(share, reaction.rate)
            for reaction in self.reactions
            for name, share in reaction.changes
            if name == own.id
        ]
        whole = total(terms)
        return times(symbol(own.factor), whole) if own.factor else whole

    def varies(self, compartment: str) -> bool:
        """Whether a compartment has another size later on."""
        return self.quantities[compartment].rule is not None

    def start(self, own: Quantity) -> Expr | None:
        """Where a quantity starts, in what formulas mean by it; none where the model does not say."""
        if own.initial is None or own.kind != "species" or own.is_assigned:
            return own.initial
        size = symbol(own.compartment)
        if own.starts_as_amount and not own.is_amount:
            return over(own.initial, size)
        if not own.starts_as_amount and own.is_amount:
            return times(own.initial, size)
        return own.initial
