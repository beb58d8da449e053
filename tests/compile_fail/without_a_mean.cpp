// words: cairn: this needs a mean and a covariance at every moment; take a filter of another form
// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include <cairn/filter/information.hpp>
#include <cairn/filter/smoother.hpp>

#include "models.hpp"

using Record = cairn::Recorder<cairn::InformationFilter, Process::State>;
static_assert(sizeof(Record) > 0);
