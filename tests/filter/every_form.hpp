// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// The filters of Gaussian beliefs, all nine, for what each of them has to do.
#pragma once

#include <optional>

#include <cairn/core/linalg.hpp>
#include <cairn/filter/augmented_unscented.hpp>
#include <cairn/filter/extended.hpp>
#include <cairn/filter/filter.hpp>
#include <cairn/filter/information.hpp>
#include <cairn/filter/kalman.hpp>
#include <cairn/filter/square_root.hpp>
#include <cairn/filter/square_root_information.hpp>
#include <cairn/filter/ud.hpp>
#include <cairn/filter/unscented.hpp>

namespace cairn_test {

/// run(name, filter) for each whose beliefs always have a mean.
template <class Run>
void each_proper_form(const Run& run) {
  run("Kalman", cairn::Kalman{});
  run("Extended", cairn::Extended{});
  run("Unscented", cairn::Unscented{});
  run("AugmentedUnscented", cairn::AugmentedUnscented{});
  run("SquareRoot", cairn::SquareRoot{});
  run("SquareRootUnscented", cairn::SquareRootUnscented{});
  run("UDFilter", cairn::UDFilter{});
}
/// And for the information forms.
template <class Run>
void each_form(const Run& run) {
  each_proper_form(run);
  run("InformationFilter", cairn::InformationFilter{});
  run("SquareRootInformationFilter", cairn::SquareRootInformationFilter{});
}

template <class T>
const T& sure(const T& value) {
  return value;
}
template <class T>
const T& sure(const std::optional<T>& value) {
  return value.value();
}

/// The belief of `filter` that says what `prior` says.
template <class Filter, class X>
cairn::BeliefOf<Filter, X> begin_with(const Filter&, const cairn::Gaussian<X>& prior) {
  const auto made = cairn::BeliefOf<Filter, X>::from(prior);
  return sure(made);
}
template <cairn::Belief B>
cairn::Gaussian<typename B::State> as_gaussian(const B& belief) {
  const auto gaussian = belief.gaussian();
  return sure(gaussian);
}

/// Every number of two beliefs is the same, bit for bit but for the sign of zero.
template <cairn::Belief B>
bool same_numbers(const B& a, const B& b) {
  const auto same = [](const auto& x, const auto& y) {
    return x.rows() == y.rows() && x.cols() == y.cols() && (x.array() == y.array()).all();
  };
  if constexpr (requires { a.information; })
    return same(a.point, b.point) && same(a.information, b.information) && same(a.vector, b.vector);
  else if constexpr (requires { a.point; })
    return same(a.point, b.point) && same(a.root, b.root) && same(a.vector, b.vector);
  else if constexpr (requires { a.upper; })
    return same(a.mean, b.mean) && same(a.upper, b.upper) && same(a.diagonal, b.diagonal);
  else if constexpr (requires { a.root; })
    return same(a.mean, b.mean) && same(a.root, b.root);
  else
    return same(a.mean, b.mean) && same(a.covariance, b.covariance);
}

}  // namespace cairn_test
