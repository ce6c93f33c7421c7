import numpy as np
import pytest

from tracker_node.errors import ModelError, UnknownNameError
from tracker_node.model.kinematic_chain import Axis, Following, Joint, KinematicChain


def joint(parent, child, *axes):
    return Joint(f"{parent}_{child}", parent, child, np.eye(4), tuple(Axis(name, (1.0, 0.0, 0.0)) for name in axes))


def test_links_come_before_their_children_whatever_the_order_given():
    chain = KinematicChain(("tip", "middle", "base"), (joint("middle", "tip", "c"), joint("base", "middle", "a", "b")))
    assert chain.links == ("base", "middle", "tip")
    assert chain.parents.tolist() == [-1, 0, 1]
    assert chain.dof_names[6:] == ("a", "b", "c")
    assert chain.link_moved_by.sum(axis=1).tolist() == [6, 8, 9]
    assert chain.axis_index("c") == 2


@pytest.mark.parametrize(("links", "joints", "message"), [
    (("a", "b", "c"), (joint("a", "b"), joint("c", "b")), "two parents"),
    (("a", "b"), (joint("a", "b"), joint("b", "a")), "cycle"),
    (("a", "b", "c"), (joint("b", "c"), joint("c", "b")), "cycle"),
    (("a", "b"), (), "one root"),
    (("a", "a"), (), "unique"),
    (("a", "b", "c"), (joint("a", "b", "q"), joint("b", "c", "q")), "degree-of-freedom names"),
])  # fmt: skip
def test_what_is_no_tree_is_refused(links, joints, message):
    with pytest.raises(ModelError, match=message):
        KinematicChain(links, joints)


def test_positions_beyond_limits_are_told():
    chain = KinematicChain(("a", "b"), (joint("a", "b", "q", "r"),))
    assert chain.beyond_limits(np.array([3.0, -3.0])) == []
    assert chain.beyond_limits(np.array([3.2, 0.0])) == ["q: 3.2 is not in [-3.142, 3.142] rad"]
    assert len(chain.beyond_limits(np.array([np.nan, -4.0]))) == 2


def test_unknown_names_list_the_valid_ones():
    with pytest.raises(UnknownNameError, match="'x'; valid: a, b"):
        KinematicChain(("a", "b"), (joint("a", "x"),))
    chain = KinematicChain(("a", "b"), (joint("a", "b", "q"),))
    with pytest.raises(UnknownNameError, match="link 'x'"):
        chain.link_index("x")
    with pytest.raises(UnknownNameError, match="axis 'x'; valid: q"):
        chain.axis_index("x")


@pytest.mark.parametrize(("values", "message"), [
    ({"direction": (1.0, 1.0, 0.0)}, "unit direction"),
    ({"lower": 1.0, "upper": 1.0}, "lower < upper"),
    ({"lower": 0.5, "upper": 1.0}, "neutral"),
])  # fmt: skip
def test_bad_axes_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        Axis(**{"name": "q", "direction": (1.0, 0.0, 0.0), **values})


def test_axes_that_follow_each_other_in_a_circle_are_refused():
    def following(*leaders: str) -> KinematicChain:
        axes = [Axis(f"q{i}", (1.0, 0.0, 0.0), mimic=Following(leader) if leader else None) for i, leader in enumerate(leaders)]
        return KinematicChain(("a", "b"), (Joint("ab", "a", "b", np.eye(4), tuple(axes)),))

    assert [axis for axis, *_ in following("", "q0", "q1", "q0").couplings] == [1, 2, 3]
    with pytest.raises(ModelError, match=r"in a circle: \['q1', 'q2', 'q3'\]"):  # the last follows those that do
        following("", "q2", "q1", "q2")
