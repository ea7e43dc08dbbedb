"""How MATLAB writes expressions, and the functions that an exported observer may need."""

from collections.abc import Iterator

from obsdesign.exports.code import Language
from obsdesign.exports.subject import ITERATIONS, shortest

BUILT_IN = ("sin", "cos", "tan", "atan", "sinh", "cosh", "tanh", "exp", "abs", "sign", "atan2", "pi")
OWN = {  # of a real number, without an error or a complex number where the value is none
    "square": ("y = square(x)", "y = x*x;"),
    "cube": ("y = cube(x)", "y = x*x*x;"),
    "sat": ("y = saturated(x)", "y = choose(x < -1, -1, choose(x > 1, 1, x));"),
    "min": ("y = lower(a, b)", "y = choose(a <= b || isnan(a), a, b);"),
    "max": ("y = upper(a, b)", "y = choose(a >= b || isnan(a), a, b);"),
    "sqrt": ("y = root(x)", "y = choose(x < 0, NaN, sqrt(abs(x)));"),
    "log": ("y = ln(x)", "y = choose(x < 0, NaN, log(abs(x)));"),
    "asin": ("y = arcsin(x)", "y = choose(abs(x) > 1, NaN, real(asin(x)));"),
    "acos": ("y = arccos(x)", "y = choose(abs(x) > 1, NaN, real(acos(x)));"),
    "**": ("y = raised(a, b)", "y = choose(a < 0 && b ~= fix(b), NaN, real(a^b));"),
}
CALLED = {name: head[4 : head.index("(")] for name, (head, _) in OWN.items()}
WORDS = """break case catch classdef continue do else elseif end end_try_catch end_unwind_protect endfor endfunction
endif endswitch endwhile for function global if otherwise parfor persistent return spmd switch try until unwind_protect
unwind_protect_cleanup while ans NaN Inf true false nargin s u x y out known a r J xhat0 zeros choose finite numbers
newton solved started estimates step_state jump_state flow_state begin_state locate_state"""
RESERVED = frozenset([*WORDS.split(), *BUILT_IN, *CALLED.values(), *(name for name in OWN if name.isalpha())])


def language() -> Language:
    """How MATLAB writes expressions."""
    return Language(
        number=shortest,
        functions={**{name: name for name in BUILT_IN}, **CALLED},
        choice="choose({c}, {a}, {b})",
        unequal="~=",
    )


def helpers(tongue: Language, ID: str, text: str) -> Iterator[str]:
    """Functions that a text of MATLAB uses, and those that these use."""
    for name, (head, body) in OWN.items():
        if name in tongue.used:
            yield f"function {head}\n{body}\nend"
            text += body
    for name, body in CHECKS.items():
        if f"{name}(" in text:
            yield body.replace("ID:", f"{ID}:")


CHECKS = {
    "choose": """\
function y = choose(condition, a, b)
if condition
    y = a;
else
    y = b;
end
end""",
    "newton": f"""\
function a = newton(equations, known, n)
% Solve r(a) = 0 by Newton's method from a = 0, with steps that are halved until |r| falls.
a = zeros(n, 1);
for k = 1:{ITERATIONS}
    [r, J] = equations(known, a);
    before = sum(r.^2);
    if ~isfinite(before)
        break
    end
    step = solved(J, -r);
    share = 1;
    for half = 1:40
        b = a + share*step;
        if sum(equations(known, b).^2) <= before
            break
        end
        share = share/2;
    end
    a = b;
    if max(abs(step)) <= 1e-10*(1 + max(abs(a)))
        return
    end
end
error('ID:equation', 'an algebraic loop does not converge');
end

function x = solved(A, b)
% Solution of A x = b by elimination with pivots; not finite where there is none.
n = numel(b);
for k = 1:n
    [~, p] = max(abs(A(k:n, k)));
    order = [k + p - 1, k];
    A([k, k + p - 1], :) = A(order, :);
    b([k, k + p - 1]) = b(order);
    for i = k + 1:n
        m = A(i, k)/A(k, k);
        A(i, :) = A(i, :) - m*A(k, :);
        b(i) = b(i) - m*b(k);
    end
end
x = zeros(n, 1);
for i = n:-1:1
    x(i) = b(i);
    for j = i + 1:n
        x(i) = x(i) - A(i, j)*x(j);
    end
    x(i) = x(i)/A(i, i);
end
end""",
    "finite": """\
function v = finite(v)
% What equations give, where it is finite.
if ~all(isfinite(v))
    error('ID:equation', 'an equation has no finite value');
end
end""",
    "numbers": """\
function v = numbers(v, n, name)
% Values as a column of so many finite numbers.
if ~isnumeric(v) || ~isreal(v) || numel(v) ~= n || ~all(isfinite(v(:)))
    error('ID:input', '%s is not %d finite numbers', name, n);
end
v = double(v(:));
end""",
}
