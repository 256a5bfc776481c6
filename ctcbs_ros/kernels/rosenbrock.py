"""Steinebach's Rosenbrock pair RODASP: order 4(3), linearly implicit, L-stable, stiffly accurate.

For y' = f(t, y), J = df/dy, with the stages u_i in the form that needs no product with J:

    (1/(G h) - J) u_i = f(t + ALPHA_i h, y + sum_j A_ij u_j) + sum_j C_ij u_j/h + D_i h df/dt

The new state is that of the last stage, y + sum_j A_6j u_j, plus u_6, which is also the error of
the formula of order 3. Between both ends, at a part s of the step, the state is to order 3

    (1 - s) y_0 + s (y_1 + (1 - s) (sum_j E_0j u_j + s sum_j E_1j u_j)).

Its order does not fall where a stiff problem is driven from its boundary,
as a cable is at its tow point.

References
----------
Steinebach, Order reduction of ROW methods for DAEs and method of lines applications, TH Darmstadt
1995; Hairer and Wanner, Solving Ordinary Differential Equations II, 1996, IV.7 and VI.4.
"""

import numpy as np

STAGES = 6
G = 0.25
ALPHA = np.array([0.0, 0.75, 0.21, 0.63, 1.0, 1.0])
D = np.array([0.25, -0.5, -0.023504, -0.0362, 0.0, 0.0])
A = np.zeros((STAGES, STAGES))
A[1, :1] = 3.0
A[2, :2] = 1.831036793486759, 0.4955183967433795
A[3, :3] = 2.304376582692669, -0.05249275245743001, -1.176798761832782
A[4, :4] = -7.170454962423024, -4.741636671481785, -16.31002631330971, -1.062004044111401
A[5, :4] = A[4, :4]
A[5, 4] = 1.0
C = np.zeros((STAGES, STAGES))
C[1, :1] = -12.0
C[2, :2] = -8.791795173947035, -2.207865586973518
C[3, :3] = 10.81793056857153, 6.780270611428266, 19.53485944642410
C[4, :4] = 34.19095006749676, 15.49671153725963, 54.74760875964130, 14.16005392148534
C[5, :4] = 34.62605830930532, 15.30084976114473, 56.99955578662667, 18.40807009793095
C[5, 4] = -5.714285714285717
E = np.zeros((2, STAGES))
E[0, :4] = 25.09876703708589, 11.62013104361867, 28.49148307714626, -5.664021568594133
E[1, :5] = (
    1.638054557396973, -0.7373619806678748, 8.477918219238990, 15.99253148779520,
    -1.882352941176471,
)  # fmt: skip
