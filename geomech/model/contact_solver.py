"""Settings of the open–close iteration: its methods of finding contact states, and their parameters.

``geomech bench contact-solver`` measures the effect of each method and number, by switching methods off one by one, on
random slopes, slopes and walls under sudden weight, arches, debris and strength reduction.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ContactSolver:
    """Settings of the contact solver; fractions of 1 and counts unless a unit is given.

    Newton's method on contact states (`dda.open_close.iteration`)
    newton_reduction     it continues while the number of inconsistent contacts falls to this fraction of its minimum …
    newton_tries         … or for this many iterations without such a reduction: more are useless on sliding slopes
    newton_tries_if_few  … or for this many if few are inconsistent; an iteration costs a fifth of one of the path
    few_wrong            fraction of the contacts that counts as few
    newton_to_finish     largest number of iterations from states proposed by the path

    Bonds
    bonds_in_order       number of contacts up to which bonds break one by one, in the order of a growing load; with
                         more contacts, those at least half as overloaded as the worst break together (a bonded slope of
                         200 blocks takes 412 iterations one by one)

    Slivers, for which no states may be consistent: states that recur are accepted if
    sliver_contacts      no more than this many contacts are inconsistent, …
    sliver_force         … each by no more than this fraction of the largest force on its blocks

    Patches of blocks around contacts that stay inconsistent (`dda.open_close.block_patches`)
    patches              whether they are used
    patch_tries          largest number of times in a step
    patch_wrong          largest fraction of inconsistent contacts
    patch_rings          number of rings of blocks around these contacts
    patch_share          largest fraction of all blocks in a patch, …
    patch_blocks         … and largest number: its factors are kept in addition to those of all blocks

    Operator splitting (`dda.open_close.operator_splitting`) in dynamic steps
    splitting              whether it proposes states before the central path does
    splitting_violation    used at once if the forces of inconsistent contacts are more than this fraction of all normal
                           forces (after an impact on a slope of 1 000 blocks Newton's method fails from there; 0.01 to
                           0.1 take the same number of factorisations)
    splitting_wrong        patches are tried first if fewer than this fraction of the contacts is inconsistent
    splitting_iterations   largest number of substitutions: after 60, Newton's method mostly converges in four iterations
                           on a slope of 1 000 blocks after an impact
    splitting_settled      … or until no more than this fraction of the states changes in ten iterations

    Operator splitting in the trials of a factor of safety, continued until forces balance (`dda.open_close.static_splitting`)
    static_splitting                number of free blocks from which it takes the place of the central path
    static_splitting_soft           stiffness of its springs at first, relative to that of the softest contact: forces spread
                                    over a slope of 3 400 blocks in a quarter of the iterations …
    static_splitting_stiff          … and later, with which few contacts keep changing
    static_splitting_begin          number of iterations with soft springs, if contacts carry nothing at first
    static_splitting_period         number of iterations whose mean is looked at
    static_splitting_iterations     largest number of iterations, each of one substitution
    static_splitting_balance        largest unbalanced force on a block in the mean, relative to the largest force on it, …
    static_splitting_cycle          … and at slivers where iterates go round in a cycle, …
    static_splitting_cycling        … which may be this fraction of the blocks
    static_splitting_change         largest change of the mean forces between two periods, relative to their mean
    plastic_splitting               number of free blocks from which it is used with cohesion, joint stiffness or bolts
                                    (`dda.open_close.plastic_splitting`): 87 blocks with cohesion have their bound in 1 s; Newton's
                                    method, which breaks bonds one by one, ends 7 % below it after 31 s
    plastic_splitting_alone         … and with friction alone, and from which dilation is left out: of 1 004 blocks Newton's method finds
                                    no contact states in minutes; among 110 to 340 blocks it gives factors to 1e-4 in 1 to 9 s,
                                    splitting to 2e-3 in 1 to 4 s
    plastic_splitting_gives         stiffness of springs that give, relative to others: bolts of 1e7 N/m between blocks of
                                    20 GPa take up their forces in hundreds of iterations instead of tens of thousands

    Central path (`dda.open_close.interior_point`)
    central_path            whether it is used
    path_iterations         largest number of iterations in a step; successful paths take 13 to 40
    path_undecided          it proposes states when no more than this many contacts are undecided, …
    path_undecided_share    … and no more than this fraction of them, or two, …
    path_balance            … and no more than this fraction of the loads is unbalanced
    path_start              initial ε in units of the mean of N²/kₙ (1 takes a third more iterations) …
    path_least_start        … and its lower limit, in units of the squared load over the stiffness
    path_correctors         largest number of correctors per step (Gondzio 1996; without, a quarter more iterations)
    path_recentred          number of times that contacts are centred again when they block the path, …
    path_recentred_larger   … with ε larger by this factor
    path_load_rings         number of rings of blocks over which the largest force is a contact's load: a pebble below a
                            large block carries the load of that block

    large_system            number of free blocks from which a dynamic step is halved as soon as its path is stopped: on a
                            slope of 20 000 blocks under sudden weight no states were found in 126 s, in half the step
                            after 43 iterations
    single_precision_only   number of free blocks from which a dynamic step whose equations are beyond single precision is
                            halved, instead of factored in double, which takes 1.6 GB more for 100 000 blocks. (A slope of
                            10 000 moved in steps of a third to a quarter of those with double factors.)
    """

    newton_reduction: float = 0.55
    newton_tries: int = 1
    newton_tries_if_few: int = 4
    few_wrong: float = 0.05
    newton_to_finish: int = 8
    bonds_in_order: int = 40
    sliver_contacts: int = 8
    sliver_force: float = 1e-4
    patches: bool = True
    patch_tries: int = 6
    patch_wrong: float = 0.1
    patch_rings: int = 2
    patch_share: float = 0.4
    patch_blocks: int = 2000
    splitting: bool = True
    splitting_violation: float = 0.03
    splitting_wrong: float = 0.02
    splitting_iterations: int = 60
    splitting_settled: float = 0.001
    static_splitting: int = 1500
    static_splitting_soft: float = 0.005
    static_splitting_stiff: float = 0.02
    static_splitting_begin: int = 1250
    static_splitting_period: int = 250
    static_splitting_iterations: int = 8000
    static_splitting_balance: float = 1e-3
    static_splitting_cycle: float = 0.05
    static_splitting_cycling: float = 3e-3
    static_splitting_change: float = 3e-4
    plastic_splitting: int = 50
    plastic_splitting_alone: int = 500
    plastic_splitting_gives: float = 0.01
    central_path: bool = True
    path_iterations: int = 60
    path_undecided: int = 12
    path_undecided_share: float = 0.006
    path_balance: float = 1e-3
    path_start: float = 100.0
    path_least_start: float = 0.1
    path_correctors: int = 3
    path_recentred: int = 4
    path_recentred_larger: float = 10.0
    path_load_rings: int = 3
    large_system: int = 3000
    single_precision_only: int = 30_000
