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
