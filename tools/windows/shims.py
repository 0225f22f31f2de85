"""C sources of two libraries that Wine 10 lacks: complex functions of `ucrtbase`, converters of `icuuc`."""

from collections.abc import Iterable

_TO_NUMBER = ("cabs", "carg", "cimag", "creal")
_TO_COMPLEX = (
    "conj", "cproj", "cexp", "clog", "clog10", "csqrt", "csin", "ccos", "ctan", "csinh", "ccosh", "ctanh",
    "casin", "cacos", "catan", "casinh", "cacosh", "catanh",
)  # fmt: skip
_BUILDERS = {"_Cbuild": ("D", "double"), "_LCbuild": ("D", "double"), "_FCbuild": ("F", "float")}
_HEAD = """\
#include <complex.h>
#include <math.h>
/* Windows has complex numbers as structures; long double is double there. */
typedef struct { double re, im; } D;
typedef struct { float re, im; } F;
static double complex from_D(D z) { double complex c; __real__ c = z.re; __imag__ c = z.im; return c; }
static double complex from_F(F z) { double complex c; __real__ c = z.re; __imag__ c = z.im; return c; }
static D to_D(double complex c) { D z = {__real__ c, __imag__ c}; return z; }
static F to_F(double complex c) { F z = {__real__ c, __imag__ c}; return z; }
"""
_ICU = (
    "ucnv_close", "UCNV_FROM_U_CALLBACK_SUBSTITUTE", "UCNV_TO_U_CALLBACK_SUBSTITUTE", "ucnv_reset",
    "ucnv_getMaxCharSize", "ucnv_getName", "ucnv_getToUCallBack", "ucnv_getFromUCallBack",
    "ucnv_setToUCallBack", "ucnv_setFromUCallBack", "ucnv_cbToUWriteUChars", "ucnv_toUnicode",
    "ucnv_cbFromUWriteUChars", "ucnv_toUCountPending", "ucnv_fromUCountPending", "ucnv_getStandardName",
    "ucnv_getAvailableName", "ucnv_countAvailable", "ucnv_fromUnicode",
)  # fmt: skip
_FILE_ERROR = 4  # of ICU: no such converter, so Qt takes its own


def complex_functions(exported: Iterable[str], original: str) -> tuple[str, str]:
    """Source and definition file of a `ucrtbase` with complex functions.

    Wine's own declares them and stops the program that calls one. All other functions are those of
    `original`, a copy of Wine's own under another name; `exported` are the names that it exports.
    """
    names = sorted(set(exported))
    functions = {name: code for name, code in _functions() if name in names}
    lines = [f'"{name}" = "{original}.{name}"' for name in names if name not in functions]
    lines += [f'"{name}" = own_{name}' for name in functions]
    definition = "\n".join(["LIBRARY ucrtbase.dll", "EXPORTS", *lines, ""])
    return "\n".join([_HEAD, *functions.values(), ""]), definition


def icu_converters() -> str:
    """Source of an `icuuc` that has no converter, which Qt wants to load."""
    lines = [f"__declspec(dllexport) long long {name}(void) {{ return 0; }}" for name in _ICU]
    opening = "__declspec(dllexport) void *ucnv_open(const char *name, int *error)"
    return "\n".join([f"{opening} {{ (void)name; *error = {_FILE_ERROR}; return 0; }}", *lines, ""])


def _functions() -> Iterable[tuple[str, str]]:
    for suffix, kind in (("", "D"), ("f", "F"), ("l", "D")):
        number = "float" if kind == "F" else "double"
        for base in _TO_NUMBER:
            yield base + suffix, f"{number} own_{base}{suffix}({kind} z) {{ return {base}(from_{kind}(z)); }}"
        for base in _TO_COMPLEX:
            value = f"clog(from_{kind}(z)) / log(10.0)" if base == "clog10" else f"{base}(from_{kind}(z))"
            yield base + suffix, f"{kind} own_{base}{suffix}({kind} z) {{ return to_{kind}({value}); }}"
        power = f"to_{kind}(cpow(from_{kind}(a), from_{kind}(b)))"
        yield f"cpow{suffix}", f"{kind} own_cpow{suffix}({kind} a, {kind} b) {{ return {power}; }}"
    for name, (kind, number) in _BUILDERS.items():
        yield name, f"{kind} own_{name}({number} re, {number} im) {{ {kind} z = {{re, im}}; return z; }}"
