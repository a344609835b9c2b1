// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// COLMAP's classes, and what is named or called otherwise from version to
// version: the only way to a COLMAP header for what lies outside host/. A
// folder host/vN holds one version's form of it, and the sources that call its
// library; the headers of host/ are the same for all (docs/reference/host.md).
#include "colmap_ext/host/v3/colmap.h"
