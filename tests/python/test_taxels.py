"""Points of touch on finger pads. Oracle: the contacts that they are of."""
import handsim as hs
import numpy as np
import pytest


def test_forces_add_up_to_those_of_the_contacts_on_the_pads():
    sim = hs.Simulation("grasp_pinch")
    sim.step(substeps=2500)  # held
    touch = sim.taxels(spacing=1e-3)
    contacts = sim.contacts
    normal = np.einsum("ij,ij->i", contacts.force, contacts.normal)
    on_pads = [a.endswith("_distal") or b.endswith("_distal") for a, b in zip(contacts.a, contacts.b)]
    assert np.any(on_pads)
    assert touch.forces.sum() == pytest.approx(normal[on_pads].sum(), abs=1e-12)
    assert sum(touch.counts) == len(touch.forces) == len(touch.points) == len(touch.areas)
    assert np.all(touch.forces >= 0)


def test_a_spacing_of_nothing_is_refused():
    sim = hs.Simulation("grasp_pinch")
    with pytest.raises(hs.Error):
        sim.taxels(spacing=0)
