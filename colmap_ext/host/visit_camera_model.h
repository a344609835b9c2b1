// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// COLMAP's camera models as types; apart from colmap.h, as they bring Ceres.
#include "colmap_ext/host/v3/visit_camera_model.h"
