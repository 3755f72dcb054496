"""How the open–close iteration looks for contact states: the ways it goes, and the numbers that these are tuned by.

``geomech bench contact-solver`` switches the methods off one by one and measures what each number is worth, over random
slopes, slopes and walls under sudden weight, arches, debris and strength reduction: "measured" below means there.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ContactSolver:
    """Settings of the contact solver. Parts are of 1, numbers are counts, unless a unit is given.

    Newton's method on contact states (`dda.open_close.iteration`)
    newton_reduction     goes on while the wrong contacts fall to this part of the fewest so far …
    newton_tries         … or for so many iterations although they do not: more lead nowhere on slopes that slide
    newton_tries_if_few  … or for so many where few are wrong, and an iteration costs a fifth of one of the path
    few_wrong            part of the contacts that are few
    newton_to_finish     iterations from states that the path proposes to the end

    Bonds
    bonds_in_order       contacts up to which bonds break one by one, as a load that grows would break them; of more,
                         those half as overloaded as the worst go together (a glued slope of 200 blocks: 412
                         iterations one by one)

    Slivers, of which no set of states may fit: states that return stand where
    sliver_contacts      no more contacts are wrong than so many, …
    sliver_force         … by no more than this part of the largest force on either of their blocks

    Patches of blocks about contacts that stay wrong (`dda.open_close.block_patches`)
    patches              whether they are settled by themselves
    patch_tries          this many times in a step
    patch_wrong          where no more than this part of all contacts is wrong
    patch_rings          patches reach so many blocks beyond these contacts
    patch_share          and have at most this part of all blocks, …
    patch_blocks         … and so many: their factors stand beside those of all

    Operator splitting (`dda.open_close.operator_splitting`), of steps in motion
    splitting              whether it proposes states before the central path does
    splitting_violation    at once where the forces of wrong contacts are more than this part of all normal forces (after
                           an impact on a slope of 1 000 blocks Newton's method leads nowhere from there: 0.01 to 0.1 take
                           as many factorisations)
    splitting_wrong        where fewer than this part of the contacts is wrong, patches are tried before
    splitting_iterations   substitutions at most: from the states of 60 Newton's method mostly ends in four iterations on
                           a slope of 1 000 blocks that an impact shakes
    splitting_settled      … or until no more than this part of the states changes within ten of them

    Central path (`dda.open_close.interior_point`)
    central_path            whether it is followed
    path_iterations         so many at most in a step; what ends well takes 13 to 40
    path_undecided          it proposes states when no more contacts are undecided than so many, …
    path_undecided_share    … nor than this part of them, or than two, …
    path_balance            … and no more than this part of the loads is out of balance
    path_start              ε begins at so many times the mean of N²/kₙ (1 takes a third more iterations) …
    path_least_start        … and not below this, in units of the squared load over the stiffness
    path_correctors         correctors of a step at most (Gondzio 1996; none: a quarter more iterations)
    path_recentred          this many times contacts are centred again where steps have become short, …
    path_recentred_larger   … with so much larger an ε
    path_load_rings         a contact's load is the largest within so many blocks of it: a pebble below a large block
                            bears that one's
    path_blocked            the path is blocked after so many steps in a row …
    path_short              … that go less than this part of the way

    large_system            free blocks from which a step in motion is halved as soon as its path is stopped: a slope of
                            20 000 blocks under sudden weight found no states in 126 s, its half step in 43 iterations
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
    path_blocked: int = 5
    path_short: float = 0.05
    large_system: int = 3000
