// words: cairn: a State and a Measurement are; cairn::manifold_traits
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/gaussian.hpp>

struct Mine {
  double number = 0;
};
static_assert(sizeof(cairn::Gaussian<Mine>) > 0);
