// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A grid whose copies share what none of them has changed, as one grid of observations with a tree of who
/// made them: the maps of DP-SLAM.
///
/// Copies of one grid are leaves of a tree. A cell holds an entry for each node of the tree that wrote it,
/// and a leaf reads the entry of its nearest ancestor. Nodes that nobody holds and that have no children die
/// and take their entries along; a node that nobody holds and that has one child becomes one with it, the
/// child's entries being the newer. So P grids have at most 2 P - 1 nodes, and the tree's memory does not
/// grow with time. (A. Eliazar, R. Parr, "DP-SLAM 2.0", ICRA 2004, sec. II.) The same values as SharedTiles,
/// where that copies tiles this copies cells: it wins where many grids differ in few cells each.
///
/// Copying O(1); reading O(nodes between the leaf and the entry's, log(entries of the cell) each); writing
/// the same, and O(entries of the cell) at the first write to it; dying O(own entries). Grids of one tree may
/// be read by several threads at once, but not while one of them is written, copied or destroyed: guard().
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include <cairn/grid/shared_tiles.hpp>
#include <cairn/grid/tile.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

template <class Cell>
class Ancestry {
  /// Where each cell's value was found, or null: a page for each tile met.
  template <class Value>
  class Scratch {
  public:
    [[nodiscard]] Value*& operator()(CellAddress cell) { return write_(cell); }

  private:
    // On the heap, so that moving this leaves the writer's grid where it is.
    std::unique_ptr<SharedTiles<Value*>> known_ = std::make_unique<SharedTiles<Value*>>();
    typename SharedTiles<Value*>::Writer write_{*known_};
  };

public:
  using Tile = std::array<Cell, tile_cells>;

  Ancestry() : tree_(std::make_shared<Tree>()), node_(tree_->root()) {}
  Ancestry(const Ancestry& other) : tree_(other.tree_), node_(other.node_) { tree_->hold(node_); }
  /// What is moved from is empty and of no tree: assign to it or let it go.
  Ancestry(Ancestry&& other) noexcept : tree_(std::move(other.tree_)), node_(other.node_) {}
  Ancestry& operator=(Ancestry other) noexcept {
    std::swap(tree_, other.tree_);
    std::swap(node_, other.node_);
    return *this;
  }
  ~Ancestry() {
    if (tree_) tree_->release(node_);
  }

  /// The cell, or Cell{} where nothing was written; until the next write to any grid of the tree.
  [[nodiscard]] const Cell& read(CellAddress cell) const {
    const Cell* found = tree_->find(node_, cell);
    return found == nullptr ? blank : *found;
  }
  /// The cell of this grid alone; until the next write to any grid of the tree.
  [[nodiscard]] Cell& write(CellAddress cell) {
    node_ = tree_->own(node_);
    return tree_->write(node_, cell);
  }

  /// Whether all tiles from `low` to `high` can be written: what all grids of the tree wrote together would
  /// not become too wide.
  [[nodiscard]] bool has_room(TileAddress low, TileAddress high) const {
    return tree_->cells().has_room(low, high);
  }

  /// Reads many cells many times: each is looked up in the tree once. Lives no longer than the grid, and only
  /// until any grid of the tree is written, copied or destroyed.
  class Reader {
  public:
    explicit Reader(const Ancestry& grid) : grid_(&grid) {}
    [[nodiscard]] const Cell& operator()(CellAddress cell) {
      const Cell*& known = found_(cell);
      if (known == nullptr) known = &grid_->read(cell);
      return *known;
    }

  private:
    const Ancestry* grid_;
    Scratch<const Cell> found_;
  };
  [[nodiscard]] Reader reader() const { return Reader(*this); }

  /// Writes many cells many times: each is looked up in the tree once. No grid of the tree may be read,
  /// written, copied or destroyed otherwise meanwhile.
  class Writer {
  public:
    explicit Writer(Ancestry& grid) : grid_(&grid) {}
    [[nodiscard]] Cell& operator()(CellAddress cell) {
      Cell*& known = own_(cell);
      if (known == nullptr) known = &grid_->write(cell);
      return *known;
    }

  private:
    Ancestry* grid_;
    Scratch<Cell> own_;
  };
  [[nodiscard]] Writer writer() { return Writer(*this); }

  /// Calls visit(address, tile) with a copy of every tile of which this grid has a cell, by columns, then
  /// rows.
  template <class Visit>
  void for_each_tile(Visit&& visit) const {
    tree_->cells().for_each_tile([&](TileAddress address, const auto& cells) {
      Tile tile{};
      bool any = false;
      for (std::size_t i = 0; i < tile.size(); ++i)
        if (const Cell* found = tree_->find(node_, cells[i])) {
          tile[i] = *found;
          any = true;
        }
      if (any) visit(address, static_cast<const Tile&>(tile));
    });
  }

  /// Throws Error where the tree could not hold the rectangle of these tiles as well: to be asked before the
  /// first of many writes.
  void expect_room(TileAddress low, TileAddress high) const { tree_->cells().expect_room(low, high); }

  /// Held while one thread changes a grid of the tree and others may change another.
  [[nodiscard]] std::unique_lock<std::mutex> guard() const { return std::unique_lock(tree_->mutex); }

  /// Nodes of the tree, at most twice the grids that share it, less one.
  [[nodiscard]] std::size_t nodes() const noexcept { return tree_->nodes(); }
  /// Entries of all cells of the tree.
  [[nodiscard]] std::size_t entries() const noexcept { return tree_->entries(); }
  /// Bytes of entries and of the lists of who wrote what, without what vectors keep in reserve.
  [[nodiscard]] std::size_t bytes() const noexcept { return tree_->bytes(); }
  /// Tiles that SharedTiles would hold in the place of this tree, for all its grids: what copies share
  /// counted once, and as if no grid shared anything.
  struct AsTiles {
    std::size_t shared = 0, separate = 0;
  };
  /// O(tiles (entries of one + nodes)).
  [[nodiscard]] AsTiles as_tiles() const { return tree_->as_tiles(); }
  /// Whether every promise about the tree holds, by looking at all of it.
  [[nodiscard]] bool consistent() const { return tree_->consistent(); }

private:
  using NodeNumber = std::uint32_t;
  static constexpr NodeNumber none = ~NodeNumber{0};

  // Entries carry a name that a node has, not its number: a merger exchanges names and so need not touch the
  // entries of the larger side, nor those who know the numbers.
  struct Entry {
    std::uint32_t name;
    Cell value;
  };
  using Entries = std::vector<Entry>;  // of one cell, by rising names, at most one each

  class Tree {
  public:
    [[nodiscard]] NodeNumber root() { return add(none); }
    void hold(NodeNumber node) noexcept { ++nodes_[node].holders; }
    void release(NodeNumber node) {
      --nodes_[node].holders;
      tidy(node);
    }

    /// The node if its holder is alone with it, else a child that is the holder's alone.
    [[nodiscard]] NodeNumber own(NodeNumber node) {
      if (nodes_[node].holders == 1 && nodes_[node].children == 0) return node;
      const NodeNumber child = add(node);
      ++nodes_[node].children;
      --nodes_[node].holders;  // of two holders one is left, or of one, and then there are two children
      return child;
    }

    [[nodiscard]] const Cell* find(NodeNumber node, CellAddress cell) const {
      return find(node, cells_.read(cell));
    }
    [[nodiscard]] const Cell* find(NodeNumber node, const Entries& entries) const {
      if (entries.empty()) return nullptr;
      for (; node != none; node = nodes_[node].parent)
        if (const Entry* entry = entry_of(entries, nodes_[node].name)) return &entry->value;
      return nullptr;
    }

    [[nodiscard]] Cell& write(NodeNumber node, CellAddress cell) {
      Entries& entries = entries_of(cell);
      const std::uint32_t name = nodes_[node].name;
      if (Entry* own = entry_of(entries, name)) return own->value;
      const Cell* inherited = find(node, entries);
      const Cell value = inherited == nullptr ? Cell{} : *inherited;
      written_[name].push_back(cell);
      return put(entries, {name, value}).value;
    }

    [[nodiscard]] const SharedTiles<Entries>& cells() const noexcept { return cells_; }
    [[nodiscard]] std::size_t nodes() const noexcept { return nodes_.size() - free_.size(); }
    [[nodiscard]] std::size_t entries() const noexcept {
      std::size_t sum = 0;
      for (const auto& cells : written_) sum += cells.size();
      return sum;
    }
    [[nodiscard]] std::size_t bytes() const noexcept {
      std::size_t sum = nodes() * (sizeof(Node) + sizeof(typename decltype(written_)::value_type));
      for (const auto& cells : written_) sum += cells.size() * sizeof(CellAddress);
      cells_.for_each_tile([&](TileAddress, const auto& tile) {
        sum += sizeof tile;
        for (const Entries& entries : tile) sum += entries.size() * sizeof(Entry);
      });
      return sum;
    }

    /// Of a tile a grid has the copy that its nearest ancestor made who wrote into it.
    [[nodiscard]] AsTiles as_tiles() const {
      AsTiles sum;
      cells_.for_each_tile([&](TileAddress, const auto& tile) {
        std::vector<bool> wrote(nodes_.size()), has_copy(nodes_.size());  // by name; by number
        for (const Entries& entries : tile)
          for (const Entry& entry : entries) wrote[entry.name] = true;
        for (const Node& grid : nodes_) {
          if (grid.holders == 0) continue;
          auto node = static_cast<NodeNumber>(&grid - nodes_.data());
          while (node != none && !wrote[nodes_[node].name]) node = nodes_[node].parent;
          if (node == none) continue;
          sum.separate += grid.holders;
          sum.shared += has_copy[node] ? 0 : 1;
          has_copy[node] = true;
        }
      });
      return sum;
    }

    [[nodiscard]] bool consistent() const {
      std::vector<std::uint32_t> children(nodes_.size()), entries(nodes_.size());
      std::vector<bool> dead(nodes_.size());
      for (const NodeNumber node : free_) dead[node] = true;
      for (std::size_t n = 0; n < nodes_.size(); ++n)
        if (!dead[n] && nodes_[n].parent != none) ++children[nodes_[n].parent];
      bool once = true;
      cells_.for_each_tile([&](TileAddress, const auto& tile) {
        for (const Entries& each : tile)
          for (std::size_t i = 0; i < each.size(); ++i) {
            ++entries[each[i].name];
            for (std::size_t k = 0; k < i; ++k) once = once && each[k].name != each[i].name;
          }
      });
      if (!once) return false;
      for (std::size_t n = 0; n < nodes_.size(); ++n) {
        const Node& node = nodes_[n];
        const std::size_t own = entries[node.name];
        if (own != written_[node.name].size() || (dead[n] && own != 0)) return false;
        if (!dead[n] && (children[n] != node.children || (node.holders == 0 && node.children < 2)))
          return false;
      }
      return true;
    }

    std::mutex mutex;

  private:
    struct Node {
      NodeNumber parent = none;
      std::uint32_t children = 0;
      std::uint32_t holders = 0;
      std::uint32_t name = 0;
    };

    [[nodiscard]] NodeNumber add(NodeNumber parent) {
      NodeNumber node = 0;
      if (free_.empty()) {
        node = static_cast<NodeNumber>(nodes_.size());
        nodes_.emplace_back().name = node;
        written_.emplace_back();
      } else {
        node = free_.back();
        free_.pop_back();
      }
      nodes_[node].parent = parent;
      nodes_[node].holders = 1;
      return node;
    }

    void remove(NodeNumber node) {
      written_[nodes_[node].name].clear();
      nodes_[node] = {.parent = none, .children = 0, .holders = 0, .name = nodes_[node].name};
      free_.push_back(node);
    }

    [[nodiscard]] Entries& entries_of(CellAddress cell) { return cells_.write(cell); }
    [[nodiscard]] static auto place_of(auto& entries, std::uint32_t name) noexcept {
      return std::ranges::lower_bound(entries, name, {}, &Entry::name);
    }
    /// The entry of this name, or null.
    [[nodiscard]] static auto* entry_of(auto& entries, std::uint32_t name) noexcept {
      const auto place = place_of(entries, name);
      return place != entries.end() && place->name == name ? &*place : nullptr;
    }
    static Entry& put(Entries& entries, Entry entry) {
      return *entries.insert(place_of(entries, entry.name), std::move(entry));
    }
    static void erase(Entries& entries, std::uint32_t name) { entries.erase(place_of(entries, name)); }

    /// Ends a node that has no use any more, and then its parent where that has none without it.
    void tidy(NodeNumber node) {
      while (node != none && nodes_[node].holders == 0 && nodes_[node].children == 0) {
        for (const CellAddress cell : written_[nodes_[node].name]) erase(entries_of(cell), nodes_[node].name);
        const NodeNumber parent = nodes_[node].parent;
        remove(node);
        if (parent != none) --nodes_[parent].children;
        node = parent;
      }
      if (node != none && nodes_[node].holders == 0 && nodes_[node].children == 1) merge(node);
    }

    /// A node that nobody holds and its only child become one: O(nodes + entries of the smaller).
    void merge(NodeNumber node) {
      const auto is_child = [&](const Node& other) { return other.parent == node; };
      const auto child =
          static_cast<NodeNumber>(std::find_if(nodes_.begin(), nodes_.end(), is_child) - nodes_.begin());
      const std::uint32_t older = nodes_[node].name, newer = nodes_[child].name;
      const bool keep_newer = written_[newer].size() >= written_[older].size();
      const std::uint32_t kept = keep_newer ? newer : older, given = keep_newer ? older : newer;
      for (const CellAddress cell : written_[given]) {
        Entries& entries = entries_of(cell);
        Entry from = std::move(*entry_of(entries, given));
        erase(entries, given);
        if (Entry* to = entry_of(entries, kept)) {
          if (!keep_newer) to->value = std::move(from.value);
        } else {
          put(entries, {kept, std::move(from.value)});
          written_[kept].push_back(cell);
        }
      }
      nodes_[child].name = kept;
      nodes_[node].name = given;
      nodes_[child].parent = nodes_[node].parent;
      remove(node);
    }

    std::vector<Node> nodes_;
    std::vector<NodeNumber> free_;
    std::vector<std::vector<CellAddress>> written_;  // by name: the cells with an entry of it
    SharedTiles<Entries> cells_;                     // shared with nobody
  };

  static inline const Cell blank{};
  std::shared_ptr<Tree> tree_;
  NodeNumber node_ = 0;
};

}}  // namespace cairn::CAIRN_ABI
