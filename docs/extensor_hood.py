"""Arms of the index's long extensors of handmodels/muscles.yaml from a network of slips (docs/muscles.md#the-extensor-hood): prints them.

A long extensor ends in a central slip on the middle phalanx and two lateral bands, which meet on the last one. To the angles q of
MCP, PIP and DIP belong paths of both, and the tendon follows the longer one, with the shares of both changing smoothly:

    central = c q_pip,  lateral = a q_pip - b q_pip^2 / 2 + t q_dip
    excursion = arm_mcp(q) - (1 - l q_mcp) s ln(w exp(central / s) + (1 - w) exp(lateral / s))

Polynomials are the least squares to the derivatives over postures in which the DIP is within 0.75 rad of 0.67 times the PIP.
"""
import numpy as np

# c, a, b, t, w, s, l: fitted to tip forces under EDC alone (Synek 2019), to the largest dorsal force and to what EDC turns.
INDEX = (6.12, 3.91, 2.14, 4.14, 0.379, 2.16, 0.217)
PRODUCTS = ((1, 2), (0, 2), (0, 1))  # axes
JOINTS = ("mcp", "pip", "dip")
ROWS = (("EDC2 and EIP", "index", INDEX, 1),)


def slips(p, q):
    c, a, b, t, w, s, loss = p
    central, lateral = c * q[1], a * q[1] - b * q[1] ** 2 / 2 + t * q[2]
    return -(1 - loss * np.clip(q[0], -0.8, 1.6)) * s * np.log(w * np.exp(central / s) + (1 - w) * np.exp(lateral / s))


def arms(p, q, h=1e-5):
    return [(slips(p, q + d) - slips(p, q - d)) / (2 * h) for d in h * np.eye(3)]


def polynomials(p):
    rows, wanted = [], []
    for q in (np.array((x, y, z)) for x in np.linspace(-0.6, 1.57, 8) for y in np.linspace(0, 1.75, 10)
              for z in np.linspace(0, 1.4, 8) if abs(z - 0.67 * y) < 0.75):
        row = np.zeros((3, 5 + len(PRODUCTS)))
        row[1, :3], row[2, 3:5] = q[1] ** np.arange(3), q[2] ** np.arange(2)
        for j, (a, b) in enumerate(PRODUCTS):
            row[a, 5 + j], row[b, 5 + j] = q[b], q[a]
        weight = np.array((0.3, 1, 1))
        rows += list(row * weight[:, None])
        wanted += list(np.array(arms(p, q)) * weight)
    return np.linalg.lstsq(np.array(rows), np.array(wanted), rcond=None)[0] * 1e-3


for name, finger, network, size in ROWS:
    c = size * polynomials(network)
    print(f"{name}: {finger}_pip.flexion: {np.round(c[:3], 6).tolist()}, {finger}_dip.flexion: {np.round(c[3:5], 6).tolist()}")
    for factor, (a, b) in zip(c[5:], PRODUCTS):
        print(f"  {finger}_{JOINTS[a]} {finger}_{JOINTS[b]}: {factor:.6f}")
