"""How a run of the solver ended, as small integers that arrays can hold, and what each of them means in words."""

RUNNING, CONVERGED, AT_BOUND, STALLED, NOT_FINITE, OUT_OF_STEPS, UNDETERMINED = range(7)

SENTENCES = {
    RUNNING: "The solver is still at work.",
    CONVERGED: "Converged: any further step would be lost in the scatter of the residuals.",
    AT_BOUND: "Converged with a parameter at its bound: the bound and not the data decides its value.",
    STALLED: "Stalled: no step makes the fit better although the gradient asks for one.",
    NOT_FINITE: "Not finite: the model fails at the start values.",
    OUT_OF_STEPS: "Out of steps: the optimum was not reached.",
    UNDETERMINED: "Converged, but a direction among the parameters has no effect on the residuals.",
}
