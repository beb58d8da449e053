// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Version of the library and the inline namespace everything lives in.
///
/// Two versions of cairn, or one version with precondition checks on and off, may meet in one program: their
/// names differ through the inline namespace, so neither silently replaces the other's inline functions.
#pragma once

// What an older compiler says of the headers themselves would name their innards, not its age.
#if defined(__clang__) ? __clang_major__ < 14 : !defined(__GNUC__) || __GNUC__ < 11
#error "cairn needs gcc 11, clang 14 or a later one (C++20 and GNU vector extensions)"
#elif __cplusplus < 202002L
#error "cairn needs C++20: -std=c++20"
#endif
// With it a NaN would be accepted and go into the belief: isfinite() is true of everything, and x - x is
// zero.
#if (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__) || defined(__ASSOCIATIVE_MATH__)
#error "cairn has to see a NaN: no -ffast-math, -ffinite-math-only or -fassociative-math where it is included"
#endif

#define CAIRN_VERSION_MAJOR 0
#define CAIRN_VERSION_MINOR 1
#define CAIRN_VERSION_PATCH 0
#define CAIRN_VERSION_STRING "0.1.0"

/// Expensive precondition checks (CAIRN_ASSERT): on unless NDEBUG, or as the user says.
#ifndef CAIRN_CHECKED
#ifdef NDEBUG
#define CAIRN_CHECKED 0
#else
#define CAIRN_CHECKED 1
#endif
#endif

#if CAIRN_CHECKED
#define CAIRN_ABI v0_1_checked
#else
#define CAIRN_ABI v0_1
#endif

// Target cairn::compiled says CAIRN_COMPILED, which is the CAIRN_CHECKED that it was built with: it holds
// what the headers declare CAIRN_INLINE and CAIRN_INSTANCE, and such a program does not compile that again. A
// program with other checks, or for wider registers (Eigen then aligns its numbers otherwise), goes without
// it.
#if defined(CAIRN_COMPILING)  // the library itself
#define CAIRN_INSTANCE template
#define CAIRN_INLINE
#define CAIRN_ELSEWHERE 0
#elif defined(CAIRN_COMPILED) && CAIRN_COMPILED + 0 == CAIRN_CHECKED && !defined(__AVX__)
#define CAIRN_INSTANCE extern template
#define CAIRN_INLINE
#define CAIRN_ELSEWHERE 1
#else
#define CAIRN_INLINE inline
#define CAIRN_ELSEWHERE 0
#endif
