#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The cairn authors
# SPDX-License-Identifier: MIT
"""Turns a header into what Doxygen 1.9 understands: header.py FILE, to the standard output, line for line.

The inline namespace, which is only a version, goes; so do the requires-clauses of templates, by which it loses the class that they stand in.
What they demand is said by the comments and by the concepts, which stay."""
import re
import sys

CLAUSE = re.compile(r"(?<![=&|\w(] )(?<!\w)requires(?=\s*\()")


def without_clauses(text):
    out, at = [], 0
    for found in CLAUSE.finditer(text):
        if found.start() < at:
            continue
        before = text[:found.start()].rstrip()
        if not before.endswith((">", ")", "const", "noexcept")):
            continue  # a requires-expression
        end, depth = text.index("(", found.end()), 0
        while True:
            depth += {"(": 1, ")": -1}.get(text[end], 0)
            end += 1
            if depth == 0:
                more = re.match(r"\s*(&&|\|\|)\s*\(", text[end:])
                if not more:
                    break
                end += more.end() - 1
        if text[end:].lstrip().startswith("{") and before.endswith("="):
            continue
        out.append(text[at:found.start()])
        out.append("\n" * text.count("\n", found.start(), end))
        at = end
    return "".join(out) + text[at:]


text = open(sys.argv[1], encoding="utf-8").read()
text = text.replace("inline namespace CAIRN_ABI", 'extern "C++"')
sys.stdout.write(without_clauses(text))
