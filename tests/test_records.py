"""Our dataclasses mean what those of the standard library mean."""

import dataclasses

import pytest

from obsdesign.records import dataclass


def made(decorator):
    """Classes of the options that are used, made by a decorator; of those that it makes, and those of their methods."""

    @decorator(frozen=True)
    class Point:
        x: float
        names: tuple = ()
        cached: float = dataclasses.field(default=0.0, compare=False, repr=False)

    @decorator(frozen=True)
    class One:
        x: tuple

    @decorator
    class Counter:
        count: int = 0

    @decorator(frozen=True, eq=False)
    class Itself:
        x: float

    @decorator(frozen=True, kw_only=True, repr=False)
    class Named(Point):
        z: float

        def __eq__(self, other):
            return self.z == other.z

        def __hash__(self):
            return 7

        def __repr__(self):
            return "named"

    return Point, One, Counter, Itself, Named


def told(decorator):
    """What is seen of the objects of such classes."""
    Point, One, Counter, Itself, Named = made(decorator)
    a, b, c = Point(1.0, ("u",), 2.0), Point(1.0, ("u",), 3.0), Point(2.0)
    itself, named = Itself(1.0), Named(x=1.0, z=2.0)
    counter = Counter()
    counter.count += 1
    loop = Counter()
    loop.count = loop
    yield from (a == b, a == c, a != c, a == One((1.0, ("u",))), hash(a) == hash(b), {a, b} == {a}, a.__eq__(1))
    yield from (One((1,)) == One((1,)), hash(One((1,))) == hash(One((1,))), One((1,)) == Point((1,)))
    yield from (counter == Counter(1), Counter.__hash__, itself == Itself(1.0), {itself: 1}[itself])
    yield from (named == Named(x=5.0, z=2.0), hash(named))
    yield from (text.rpartition(".")[2] for text in map(repr, (a, One((1,)), counter, named, loop)))
    yield from (dataclasses.replace(a, x=4.0).x, dataclasses.asdict(c), Point.__match_args__)
    for change in (lambda: setattr(a, "x", 0.0), lambda: delattr(a, "x"), lambda: Named(1.0, z=2.0).y):
        with pytest.raises(AttributeError) as caught:
            change()
        yield type(caught.value)


def test_they_compare_hash_and_print_alike():
    assert list(told(dataclass)) == list(told(dataclasses.dataclass))
