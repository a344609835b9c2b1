// SPDX-License-Identifier: BSD-3-Clause
#include "global/view_graph/node_equations.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>
#include <stdexcept>

#include "global/view_graph/laplacian_solver.h"

namespace adasfm {
namespace {

using Vectors = NodeEquations<3>::Vectors;

struct Graph {
  std::vector<std::pair<int, int>> edges;
  std::vector<Eigen::Matrix3d> weights;
  Vectors targets;
};

// A chain of all nodes with as many edges again between any two of them.
Graph RandomGraph(int num_nodes, std::mt19937* generator) {
  std::uniform_int_distribution<int> node(0, num_nodes - 1);
  std::normal_distribution<double> normal;
  Graph graph;
  for (int i = 1; i < num_nodes; ++i) graph.edges.emplace_back(i, i - 1);
  while (static_cast<int>(graph.edges.size()) < 2 * num_nodes) {
    const int i = node(*generator);
    const int j = node(*generator);
    if (i != j) graph.edges.emplace_back(i, j);
  }
  graph.targets.resize(graph.edges.size(), 3);
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    Eigen::Matrix3d root;
    for (int k = 0; k < 9; ++k) root(k) = normal(*generator);
    graph.weights.push_back(root * root.transpose() +
                            0.1 * Eigen::Matrix3d::Identity());
    for (int k = 0; k < 3; ++k) graph.targets(e, k) = normal(*generator);
  }
  return graph;
}

// By QR of the stacked residuals, without normal equations.
Vectors SolveDensely(const Graph& graph, int num_nodes) {
  const int num_edges = graph.edges.size();
  Eigen::MatrixXd jacobian =
      Eigen::MatrixXd::Zero(3 * num_edges, 3 * num_nodes);
  Eigen::VectorXd residuals(3 * num_edges);
  for (int e = 0; e < num_edges; ++e) {
    const Eigen::Matrix3d root = graph.weights[e].llt().matrixU();
    jacobian.block<3, 3>(3 * e, 3 * graph.edges[e].first) = -root;
    jacobian.block<3, 3>(3 * e, 3 * graph.edges[e].second) = root;
    residuals.segment<3>(3 * e) = root * graph.targets.row(e).transpose();
  }
  const Eigen::VectorXd solution = jacobian.rightCols(3 * num_nodes - 3)
                                       .colPivHouseholderQr()
                                       .solve(residuals);
  Vectors nodes = Vectors::Zero(num_nodes, 3);
  for (int i = 1; i < num_nodes; ++i) {
    nodes.row(i) = solution.segment<3>(3 * i - 3).transpose();
  }
  return nodes;
}

TEST(NodeEquations, AgreeWithDenseLeastSquares) {
  for (const int seed : {1, 2, 3}) {
    std::mt19937 generator(seed);
    const int num_nodes = 30;
    const Graph graph = RandomGraph(num_nodes, &generator);
    NodeEquations<3> equations(num_nodes, graph.edges);
    Vectors nodes;
    for (int repetition = 0; repetition < 2; ++repetition) {
      equations.Clear();
      for (size_t e = 0; e < graph.edges.size(); ++e) {
        equations.Add(graph.edges[e].first, graph.edges[e].second,
                      graph.weights[e], graph.targets.row(e).transpose());
      }
      ASSERT_TRUE(equations.Solve(0.0, &nodes));
      EXPECT_LT((nodes - SolveDensely(graph, num_nodes)).norm(), 1e-9) << seed;
    }
  }
}

TEST(NodeEquations, OfScalarWeightsAgreeWithThoseOfVectors) {
  for (const int seed : {1, 2, 3}) {
    std::mt19937 generator(seed);
    const int num_nodes = 30;
    Graph graph = RandomGraph(num_nodes, &generator);
    std::vector<double> weights;
    for (Eigen::Matrix3d& weight : graph.weights) {
      weights.push_back(weight(0, 0));
      weight = weight(0, 0) * Eigen::Matrix3d::Identity();
    }
    Vectors nodes;
    ASSERT_TRUE(LaplacianSolver(num_nodes, graph.edges)
                    .Solve(weights, graph.targets, &nodes));
    EXPECT_LT((nodes - SolveDensely(graph, num_nodes)).norm(), 1e-9) << seed;
  }
}

TEST(NodeEquations, RefuseNodesWithoutEdges) {
  NodeEquations<1> equations(3, {{0, 1}, {1, 2}});
  equations.Clear();
  equations.Add(0, 1, NodeEquations<1>::Weight(1.0), {1.0, 2.0, 3.0});
  Vectors nodes = Vectors::Constant(3, 3, 7.0);
  EXPECT_FALSE(equations.Solve(1e-14, &nodes));
  EXPECT_EQ(nodes, Vectors::Constant(3, 3, 7.0));
  // The ridge holds the node that no edge reaches.
  equations.Clear(1e-6);
  equations.Add(0, 1, NodeEquations<1>::Weight(1.0), {1.0, 2.0, 3.0});
  ASSERT_TRUE(equations.Solve(1e-14, &nodes));
  EXPECT_LT((nodes.row(1) - Eigen::RowVector3d(1.0, 2.0, 3.0)).norm(), 1e-5);
  EXPECT_TRUE(nodes.row(2).isZero());
}

TEST(NodeEquations, RefuseEdgesThatJoinNoTwoNodes) {
  for (const auto& edge :
       {std::pair(0, 3), std::pair(-1, 1), std::pair(1, 1)}) {
    EXPECT_THROW(NodeEquations<3>(3, {edge}), std::invalid_argument);
  }
}

TEST(NodeEquations, OfOneNodeHaveNoUnknown) {
  NodeEquations<3> equations(1, {});
  equations.Clear();
  Vectors nodes;
  ASSERT_TRUE(equations.Solve(0.0, &nodes));
  EXPECT_TRUE(nodes.isZero());
  EXPECT_EQ(nodes.rows(), 1);
}

}  // namespace
}  // namespace adasfm
