// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Several states as one: Product<SE2, Vector<2>> is a pose and a velocity, its step (3 + 2 numbers) the
/// steps of its parts one after another.
#pragma once

#include <cstddef>
#include <tuple>
#include <type_traits>
#include <utility>

#include <cairn/core/linalg.hpp>
#include <cairn/manifold/manifold.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

namespace detail {

/// The zero vector, or what a state constructs by default.
template <class X>
[[nodiscard]] X origin() {
  if constexpr (requires { X::Zero(); })
    return X::Zero();
  else
    return X{};
}

}  // namespace detail

/// The parts side by side; part<I>() reaches one. All parts have fixed
/// size and one number type.
template <Manifold... Parts>
class Product {
public:
  /// Every part at its origin.
  Product() : parts_(detail::origin<Parts>()...) {}
  explicit(sizeof...(Parts) == 1) Product(const Parts&... parts)
    requires(sizeof...(Parts) > 0)
      : parts_(parts...) {}

  template <std::size_t I>
  [[nodiscard]] const auto& part() const noexcept {
    return std::get<I>(parts_);
  }
  template <std::size_t I>
  [[nodiscard]] auto& part() noexcept {
    return std::get<I>(parts_);
  }

private:
  std::tuple<Parts...> parts_;
};

template <Manifold... Parts>
struct manifold_traits<Product<Parts...>> {
  static_assert(((cairn::dof<Parts> != dynamic) && ...), "the parts of a Product have a fixed size");
  using Scalar = typename manifold_traits<std::tuple_element_t<0, std::tuple<Parts...>>>::Scalar;
  static_assert((std::is_same_v<Scalar, typename manifold_traits<Parts>::Scalar> && ...),
                "the parts of a Product have one number type");
  static constexpr int dof = (cairn::dof<Parts> + ...);
  using Tangent = Vector<dof, Scalar>;
  using State = Product<Parts...>;

  static State retract(const State& x, const Tangent& d) {
    return [&]<std::size_t... I>(std::index_sequence<I...>) {
      return State(manifold_traits<Parts>::retract(x.template part<I>(), segment<I>(d))...);
    }(std::index_sequence_for<Parts...>{});
  }
  static Tangent local(const State& x, const State& y) {
    Tangent d;
    [&]<std::size_t... I>(std::index_sequence<I...>) {
      ((d.template segment<cairn::dof<Parts>>(start<I>()) =
            manifold_traits<Parts>::local(x.template part<I>(), y.template part<I>())),
       ...);
    }(std::index_sequence_for<Parts...>{});
    return d;
  }

private:
  template <std::size_t I>
  static consteval int start() {
    constexpr int sizes[] = {cairn::dof<Parts>...};
    int sum = 0;
    for (std::size_t k = 0; k < I; ++k) sum += sizes[k];
    return sum;
  }
  template <std::size_t I>
  static auto segment(const Tangent& d) {
    using Part = std::tuple_element_t<I, std::tuple<Parts...>>;
    typename manifold_traits<Part>::Tangent result = d.template segment<cairn::dof<Part>>(start<I>());
    return result;
  }
};

}}  // namespace cairn::CAIRN_ABI
